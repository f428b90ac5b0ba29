"""Harmless changes of the front-end, and by how much results move: `snakemake --cores 2 spread`."""

CHANGED = [name for names in SPREAD.values() for name in names]


localrules:
    spread,


rule spread:
    input:
        SPREAD_TABLE,


rule spread_table:
    input:
        expand("data/solutions/{name}/solutions.csv", name=CHANGED),
        stamps=expand("data/solutions/{name}/stamp.json", name=CHANGED),
        code=code_of("spread"),
    output:
        csv=SPREAD_TABLE,
        stamp=SPREAD_STAMP,
    log:
        "logs/spread.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        changes=json.dumps(SPREAD),
    message:
        "Spread over harmless changes of the front-end"
    shell:
        "python -m vigauge_paper.commands.spread --changes {params.changes:q} --solutions data/solutions"
        " --output {output.csv:q} --stamps {input.stamps:q} --stamp {output.stamp:q} &> {log:q}"
