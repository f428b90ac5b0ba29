"""Experiments that explain the results: what the ledger gives as its reasons."""


rule reasons:
    input:
        **reads(
            problems=CONFIGURATIONS,
            truths=CONFIGURATIONS,
            traces=EXPERIMENTS,
            covariances=EXPERIMENTS,
            sweep_trace=[SWEEP],
        ),
        published=published("table2.csv", "fig06_prior_error_paths.csv", "fig09.npz", "fig10.npz"),
    output:
        **{name: f"data/reasons/{name}.csv" for name in UNTIMED},
        stamp="data/reasons/stamp.json",
    log:
        "logs/reasons.log",
    benchmark:
        "logs/benchmark/reasons.tsv"
    conda:
        "../envs/vigauge.yaml"
    resources:
        runtime=120,
    params:
        code=code_of("reasons"),
        problems=parameters.named("problems", CONFIGURATIONS),
        truths=parameters.named("truths", CONFIGURATIONS),
        traces=parameters.named("traces", EXPERIMENTS),
        covariances=parameters.named("covariances", EXPERIMENTS),
        published=parameters.folder_of_published,
        sweep_configuration=SWEEP,
        information=PRIOR_INFORMATION,
        solver=section("solver"),
        simulation=section("simulation"),
        settings=json.dumps({k: v for k, v in config["reasons"].items() if k in UNTIMED}, sort_keys=True),
        output=parameters.folder_of_output,
    message:
        "Running the experiments that explain the results"
    shell:
        "python -m vigauge_paper.commands.reasons --problems {params.problems:q} --truths {params.truths:q}"
        " --traces {params.traces:q} --covariances {params.covariances:q} --sweep-trace {input.sweep_trace:q}"
        " --sweep-configuration {params.sweep_configuration} {params.published}"
        " --simulation {params.simulation:q} --prior-information {params.information}"
        " --solver {params.solver:q} --settings {params.settings:q} --output {params.output:q}"
        " --stamps {input.stamps:q} --stamp {output.stamp:q} &> {log:q}"


# Times, and so in a folder of its own: everything in data/reasons is the same bytes again.
rule reasons_time:
    output:
        table="data/timing_reasons/{timed}.csv",
        stamp="data/timing_reasons/{timed}.stamp.json",
    log:
        "logs/reasons_time/{timed}.log",
    wildcard_constraints:
        timed=names_of(TIMED),
    conda:
        "../envs/vigauge.yaml"
    resources:
        **ALONE,
        runtime=120,
    params:
        code=code_of("reasons_time"),
        sweep_configuration=SWEEP,
        simulation=section("simulation"),
        solver=section("solver"),
        information=PRIOR_INFORMATION,
        settings=lambda wildcards: section("reasons", wildcards.timed),
    message:
        "Timing {wildcards.timed}"
    shell:
        "python -m vigauge_paper.commands.reasons_time --experiment {wildcards.timed}"
        " --configuration {params.sweep_configuration} --simulation {params.simulation:q}"
        " --solver {params.solver:q} --prior-information {params.information}"
        " --settings {params.settings:q} --output {output.table:q} --stamp {output.stamp:q} &> {log:q}"
