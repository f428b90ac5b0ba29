"""Experiments that explain the results: what the ledger gives as its reasons."""

# What an experiment may read, and of which configurations and sequences.
READ_BY_REASONS = {
    "problems": CONFIGURATIONS,
    "truths": CONFIGURATIONS,
    "covariances": EXPERIMENTS,
    "sweep_trace": [SWEEP],
}


# An experiment waits for what it reads only. One of them is the longest stage of all: what is long begins first.
rule reasons:
    input:
        unpack(lambda w: reads(**{kind: READ_BY_REASONS[kind] for kind in EXPLAINING[w.untimed].reads})),
        published=published("table2.csv", "fig06_prior_error_paths.csv", "fig09.npz", "fig10.npz"),
    output:
        table="data/reasons/{untimed}.csv",
        stamp="data/reasons/{untimed}.stamp.json",
    log:
        "logs/reasons/{untimed}.log",
    benchmark:
        "logs/benchmark/reasons/{untimed}.tsv"
    wildcard_constraints:
        untimed=names_of(UNTIMED),
    priority: 1
    conda:
        "../envs/vigauge.yaml"
    resources:
        runtime=120,
    params:
        code=code_of("reasons"),
        files=parameters.flags_of(READ_BY_REASONS),
        published=parameters.folder_of_published,
        sweep_configuration=SWEEP,
        information=PRIOR_INFORMATION,
        solver=section("solver"),
        simulation=section("simulation"),
        settings=lambda wildcards: json.dumps(config["reasons"].get(wildcards.untimed, {}), sort_keys=True),
    message:
        "Running the explaining experiment {wildcards.untimed}"
    shell:
        "python -m vigauge_paper.commands.reasons --experiment {wildcards.untimed} {params.files}"
        " --sweep-configuration {params.sweep_configuration} {params.published}"
        " --simulation {params.simulation:q} --prior-information {params.information}"
        " --solver {params.solver:q} --settings {params.settings:q} --output {output.table:q}"
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
