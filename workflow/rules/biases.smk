"""Biases in the state, an extension of the paper: which of its claims still hold."""


rule biases:
    input:
        **reads(reasons=["biases"]),
    output:
        png=shown("biases", ""),
        beside=beside("biases"),
        md=f"{OUT}/biases.md",
        errors=f"{OUT}/biases_errors.csv",
    log:
        "logs/paper/biases.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("biases"),
        criteria=section("claims"),
    message:
        "Judging the claims with biases in the state"
    shell:
        "python -m vigauge_paper.commands.biases --runs {input.reasons:q} --criteria {params.criteria:q}"
        " --output {output.png:q} --stamps {input.stamps:q} &> {log:q}"
