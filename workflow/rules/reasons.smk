"""Experiments that explain the results: what the ledger gives as its reasons."""

REASON_TABLES = {
    **{name: f"data/reasons/{name}.csv" for name in UNTIMED},
    # Times, and so in a folder of its own: everything in data/reasons is the same bytes again.
    **{name: f"data/timing_reasons/{name}.csv" for name in TIMED},
}


rule reasons:
    input:
        expand("data/simulation/{name}/{file}.npz", name=CONFIGURATIONS, file=["problems", "truth"]),
        expand("data/solutions/{name}/trace.csv", name=EXPERIMENTS),
        expand("data/covariance/{name}.npz", name=EXPERIMENTS),
        published=expand(
            "{folder}/{file}",
            folder=PUBLISHED_FOLDER,
            file=["table2.csv", "fig06_prior_error_paths.csv", "fig09.npz", "fig10.npz"],
        ),
        sweep_trace="data/prior_sweep/trace.csv",
        stamps=[
            *expand("data/simulation/{name}/stamp.json", name=CONFIGURATIONS),
            *expand("data/solutions/{name}/stamp.json", name=EXPERIMENTS),
            *expand("data/covariance/{name}.stamp.json", name=EXPERIMENTS),
            "data/prior_sweep/stamp.json",
        ],
        code=code_of("reasons"),
    output:
        tables=[REASON_TABLES[name] for name in UNTIMED],
        stamp="data/reasons/stamp.json",
    log:
        "logs/reasons.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        problems=expand("{name}=data/simulation/{name}/problems.npz", name=CONFIGURATIONS),
        truths=expand("{name}=data/simulation/{name}/truth.npz", name=CONFIGURATIONS),
        traces=expand("{name}=data/solutions/{name}/trace.csv", name=EXPERIMENTS),
        covariances=expand("{name}=data/covariance/{name}.npz", name=EXPERIMENTS),
        sweep_configuration=config["prior"]["sweep_configuration"],
        published=folder_of_published,
        information=PRIOR_INFORMATION,
        solver=section("solver"),
        simulation=section("simulation"),
        settings=json.dumps({k: v for k, v in config["reasons"].items() if k in UNTIMED}, sort_keys=True),
        output=folder_of_output,
    message:
        "Experiments that explain the results"
    shell:
        "python -m vigauge_paper.commands.reasons --problems {params.problems:q} --truths {params.truths:q}"
        " --traces {params.traces:q} --covariances {params.covariances:q} --sweep-trace {input.sweep_trace:q}"
        " --sweep-configuration {params.sweep_configuration} --published {params.published:q}"
        " --simulation {params.simulation:q} --prior-information {params.information}"
        " --solver {params.solver:q} --settings {params.settings:q} --output {params.output:q} --stamps {input.stamps:q} --stamp {output.stamp:q} &> {log:q}"


rule reasons_time:
    input:
        code=code_of("reasons_time"),
    output:
        table="data/timing_reasons/{experiment}.csv",
        stamp="data/timing_reasons/{experiment}.stamp.json",
    log:
        "logs/reasons_time/{experiment}.log",
    conda:
        "../envs/vigauge.yaml"
    threads: WHOLE_MACHINE
    params:
        sweep_configuration=config["prior"]["sweep_configuration"],
        simulation=section("simulation"),
        solver=section("solver"),
        information=PRIOR_INFORMATION,
        settings=lambda wildcards: section("reasons", wildcards.experiment),
    message:
        "Timing {wildcards.experiment}"
    shell:
        "python -m vigauge_paper.commands.reasons_time --experiment {wildcards.experiment} --configuration {params.sweep_configuration}"
        " --simulation {params.simulation:q} --solver {params.solver:q} --prior-information {params.information}"
        " --settings {params.settings:q} --output {output.table:q} --stamp {output.stamp:q} &> {log:q}"
