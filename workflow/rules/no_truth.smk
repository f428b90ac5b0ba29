"""Sequences whose estimate takes nothing from a ground truth: `snakemake --cores 2 no_truth`."""

BOTH_FORMS = [name for names in SEQUENCES.no_truth.values() for name in names]


rule no_truth:
    input:
        **reads(solutions=BOTH_FORMS, distances=BOTH_FORMS),
    output:
        csv=f"{OUT}/no_truth.csv",
        md=f"{OUT}/no_truth.md",
    log:
        "logs/paper/no_truth.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("no_truth"),
        forms=json.dumps(SEQUENCES.no_truth),
        solutions=parameters.named("solutions", BOTH_FORMS),
        distances=parameters.named("distances", BOTH_FORMS),
        criteria=section("claims"),
        source=SEQUENCES.source,
    message:
        "The sequences without any ground truth"
    shell:
        "python -m vigauge_paper.commands.no_truth --forms {params.forms:q} --solutions {params.solutions:q}"
        " --distances {params.distances:q} --criteria {params.criteria:q} --source {params.source}"
        " --output {output.csv:q} --stamps {input.stamps:q} &> {log:q}"
