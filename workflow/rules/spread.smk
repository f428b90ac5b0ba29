"""Harmless changes of the front-end, and by how much results move: `snakemake --cores 2 spread`."""

CHANGED = [name for names in SEQUENCES.spread.values() for name in names]


rule spread:
    input:
        **reads(solutions=CHANGED),
    output:
        csv="data/spread/spread.csv",
        md="data/spread/spread.md",
        stamp="data/spread/spread.stamp.json",
    log:
        "logs/spread.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("spread"),
        changes=json.dumps(SEQUENCES.spread),
        solutions=parameters.folder_above("solutions"),
    message:
        "Summarising the spread over harmless changes of the front-end"
    shell:
        "python -m vigauge_paper.commands.spread --changes {params.changes:q} --solutions {params.solutions:q}"
        " --output {output.csv:q} --stamps {input.stamps:q} --stamp {output.stamp:q} &> {log:q}"
