"""Sweep of what the paper does not state: a target of its own, `snakemake --cores 2 sensitivity`."""

SWEPT = [f"{key}={value}" for key, values in config["sensitivity"]["values"].items() for value in values]


localrules:
    sensitivity,


rule sensitivity:
    input:
        SENSITIVITY,


rule sensitivity_setting:
    input:
        code=code_of("sensitivity"),
    output:
        tables=expand("data/sensitivity/{{parameter}}={{value}}/{name}.csv", name=CONFIGURATIONS),
        stamp="data/sensitivity/{parameter}={value}/stamp.json",
    log:
        "logs/sensitivity/{parameter}={value}.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        trials=config["sensitivity"]["trials"],
        settings=section("simulation"),
        solver=section("solver"),
        information=PRIOR_INFORMATION,
        output=folder_of_output,
    message:
        "Sensitivity: {wildcards.parameter} = {wildcards.value}"
    shell:
        "python -m vigauge_paper.commands.sensitivity --parameter {wildcards.parameter} --value {wildcards.value}"
        " --trials {params.trials} --settings {params.settings:q} --solver {params.solver:q}"
        " --prior-information {params.information} --output {params.output:q} --stamp {output.stamp:q} &> {log:q}"


rule sensitivity_summary:
    input:
        expand("data/sensitivity/{setting}/{name}.csv", setting=SWEPT, name=CONFIGURATIONS),
        published=[f"{PUBLISHED_FOLDER}/table2.csv"],
        stamps=expand("data/sensitivity/{setting}/stamp.json", setting=SWEPT),
        code=code_of("sensitivity_summary"),
    output:
        summary=SENSITIVITY,
        stamp=SENSITIVITY_STAMP,
    log:
        "logs/sensitivity/summary.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        folder=folder_of_output,
        settings=SWEPT,
        published=folder_of_published,
        criteria=section("claims"),
    message:
        "Judging the claims over the sweep"
    shell:
        "python -m vigauge_paper.commands.sensitivity_summary --folder {params.folder:q} --settings {params.settings:q}"
        " --published {params.published:q} --criteria {params.criteria:q} --output {output.summary:q} --stamps {input.stamps:q} --stamp {output.stamp:q} &> {log:q}"
