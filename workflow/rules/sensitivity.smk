"""Sweep of what the paper does not state: a target of its own, `snakemake --cores 2 sensitivity`."""

SWEPT = [f"{key}={value}" for key, values in config["sensitivity"]["values"].items() for value in values]


rule sensitivity_setting:
    output:
        tables=expand("data/sensitivity/{{setting}}/{name}.csv", name=CONFIGURATIONS),
        stamp="data/sensitivity/{setting}/stamp.json",
    log:
        "logs/sensitivity/{setting}.log",
    wildcard_constraints:
        setting=names_of(SWEPT),
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("sensitivity"),
        changed=parameters.changed_by,
        trials=config["sensitivity"]["trials"],
        settings=section("simulation"),
        solver=section("solver"),
        information=PRIOR_INFORMATION,
        output=parameters.folder_of_output,
    message:
        "Testing the sensitivity to {wildcards.setting}"
    shell:
        "python -m vigauge_paper.commands.sensitivity {params.changed} --trials {params.trials} --settings"
        " {params.settings:q} --solver {params.solver:q} --prior-information {params.information} --output"
        " {params.output:q} --stamp {output.stamp:q} &> {log:q}"


rule sensitivity:
    input:
        expand(rules.sensitivity_setting.output.tables, setting=SWEPT),
        published=published("table2.csv"),
        stamps=expand(rules.sensitivity_setting.output.stamp, setting=SWEPT),
    output:
        summary="data/sensitivity/summary.csv",
        stamp="data/sensitivity/summary.stamp.json",
    log:
        "logs/sensitivity/summary.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("sensitivity_summary"),
        folder=parameters.folder_of_output,
        settings=SWEPT,
        published=parameters.folder_of_published,
        criteria=section("claims"),
    message:
        "Judging the claims over the sweep"
    shell:
        "python -m vigauge_paper.commands.sensitivity_summary --folder {params.folder:q}"
        " --settings {params.settings:q} {params.published} --criteria {params.criteria:q}"
        " --output {output.summary:q} --stamps {input.stamps:q} --stamp {output.stamp:q} &> {log:q}"
