"""Experiments that explain the results: what the ledger gives as its reasons."""

REASONS = [
    "orbit",
    "yaw",
    "damping",
    "tolerance",
    "weights",
    "plateau",
    "squared",
    "squared_paths",
    "exchange",
    "first_step",
]
ITERATION_TIME = "iteration_time"
LANDMARK_TIME = "data/timing_reasons/landmark_time.csv"
ACCURACY_REASONS = ["accuracy", "sequence_accuracy", "expected", "paths", "rigid_turns"]

SCENE_REASONS = ["scene_counts", "free_spread"]


rule reasons:
    input:
        expand("data/simulation/{name}/{file}.npz", name=CONFIGURATIONS, file=["problems", "truth"]),
        expand("data/solutions/{name}/trace.csv", name=EXPERIMENTS),
        expand("data/covariance/{name}.npz", name=EXPERIMENTS),
        published=expand(
            "{folder}/{file}",
            folder=PUBLISHED_FOLDER,
            file=["fig05_prior_weight_cost.csv", "fig06_prior_error_paths.csv", "fig09.npz", "fig10.npz"],
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
        tables=expand("data/reasons/{name}.csv", name=REASONS),
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
        weight=config["prior"]["weight"],
        solver=section("solver"),
        settings=section("reasons"),
        output=folder_of_output,
    message:
        "Experiments that explain the results"
    shell:
        "python -m vigauge_paper.commands.reasons --problems {params.problems:q} --truths {params.truths:q}"
        " --traces {params.traces:q} --covariances {params.covariances:q} --sweep-trace {input.sweep_trace:q}"
        " --sweep-configuration {params.sweep_configuration} --published {params.published:q}"
        " --prior-weight {params.weight} --solver {params.solver:q} --settings {params.settings:q}"
        " --output {params.output:q} --stamps {input.stamps:q} --stamp {output.stamp:q} --log {log:q}"


rule reasons_accuracy:
    input:
        expand("data/sequences/{name}/{file}.npz", name=PAPER_SEQUENCES, file=["problem", "truth"]),
        expand("data/covariance/{name}.npz", name=EXPERIMENTS),
        published=expand(
            "{folder}/{file}",
            folder=PUBLISHED_FOLDER,
            file=["fig01_euroc_ellipses.csv", "fig09.npz", "fig10.npz"],
        ),
        stamps=[
            *expand("data/sequences/{name}/stamp.json", name=PAPER_SEQUENCES),
            *expand("data/covariance/{name}.stamp.json", name=EXPERIMENTS),
        ],
        code=code_of("reasons_accuracy"),
    output:
        tables=expand("data/reasons/{name}.csv", name=ACCURACY_REASONS),
        stamp="data/reasons/accuracy.stamp.json",
    log:
        "logs/reasons_accuracy.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        sequences=expand("{name}=data/sequences/{name}/problem.npz", name=PAPER_SEQUENCES),
        truths=expand("{name}=data/sequences/{name}/truth.npz", name=PAPER_SEQUENCES),
        covariances=expand("{name}=data/covariance/{name}.npz", name=EXPERIMENTS),
        noise=[f"{name}={headline_of(name)}" for name in PAPER_SEQUENCES],
        published=folder_of_published,
        simulation=section("simulation"),
        solver=section("solver"),
        settings=section("accuracy"),
        output=folder_of_output,
    message:
        "What the errors depend on"
    shell:
        "python -m vigauge_paper.commands.reasons_accuracy --sequences {params.sequences:q} --truths {params.truths:q}"
        " --covariances {params.covariances:q} --noise {params.noise:q} --published {params.published:q}"
        " --simulation {params.simulation:q} --solver {params.solver:q} --settings {params.settings:q}"
        " --output {params.output:q} --stamps {input.stamps:q} --stamp {output.stamp:q} --log {log:q}"


rule reasons_scenes:
    input:
        published=[f"{PUBLISHED_FOLDER}/fig05_prior_weight_cost.csv"],
        code=code_of("reasons_scenes"),
    output:
        tables=expand("data/reasons/{name}.csv", name=SCENE_REASONS),
        stamp="data/reasons/scenes.stamp.json",
    log:
        "logs/reasons_scenes.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        configuration=config["prior"]["sweep_configuration"],
        published=folder_of_published,
        simulation=section("simulation"),
        solver=section("solver"),
        settings=section("scenes"),
        output=folder_of_output,
    message:
        "What the landmarks do"
    shell:
        "python -m vigauge_paper.commands.reasons_scenes --configuration {params.configuration}"
        " --published {params.published:q} --simulation {params.simulation:q} --solver {params.solver:q}"
        " --settings {params.settings:q} --output {params.output:q} --stamp {output.stamp:q} --log {log:q}"


# Times, and so in a folder of its own: everything in data/reasons is the same bytes again.
rule reasons_time:
    input:
        code=code_of("reasons_time"),
    output:
        table=f"data/timing_reasons/{ITERATION_TIME}.csv",
        landmarks=LANDMARK_TIME,
        stamp="data/timing_reasons/stamp.json",
    log:
        "logs/reasons_time.log",
    conda:
        "../envs/vigauge.yaml"
    threads: WHOLE_MACHINE
    params:
        configuration=config["prior"]["sweep_configuration"],
        simulation=section("simulation"),
        solver=section("solver"),
        weight=config["prior"]["weight"],
        settings=section("iteration_time"),
    message:
        "What fixation saves of an iteration, and what landmarks add"
    shell:
        "python -m vigauge_paper.commands.reasons_time --configuration {params.configuration}"
        " --simulation {params.simulation:q} --solver {params.solver:q} --prior-weight {params.weight}"
        " --settings {params.settings:q} --output {output.table:q} --landmark-output {output.landmarks:q}"
        " --stamp {output.stamp:q} --log {log:q}"
