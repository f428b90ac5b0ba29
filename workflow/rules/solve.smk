"""Solves in the three gauges (Section V), for their outcome and, with the machine alone, for their time;
covariances in every gauge and the transformation between them (Section VI)."""


rule solve:
    input:
        unpack(results_of("problems", "truths")),
    output:
        solutions="data/solutions/{experiment}/solutions.csv",
        trace="data/solutions/{experiment}/trace.csv",
        states="data/solutions/{experiment}/states.npz",
        stamp="data/solutions/{experiment}/stamp.json",
    log:
        "logs/solve/{experiment}.log",
    benchmark:
        "logs/benchmark/solve/{experiment}.tsv"
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("solve"),
        prior=PRIOR_FLAGS,
        solver=section("solver"),
        noise=SEQUENCES.noise_of,
    message:
        "Solving {wildcards.experiment} in three gauges"
    shell:
        "python -m vigauge_paper.commands.solve --problems {input.problems:q} --truth {input.truths:q}"
        " {params.prior} --solver {params.solver:q} --noise {params.noise:q}"
        " --solutions {output.solutions:q} --trace {output.trace:q} --states {output.states:q}"
        " --stamps {input.stamps:q} --stamp {output.stamp:q} &> {log:q}"


rule covariance:
    input:
        unpack(results_of("problems", "states")),
    output:
        covariance="data/covariance/{experiment}.npz",
        distances="data/covariance/{experiment}.csv",
        stamp="data/covariance/{experiment}.stamp.json",
    log:
        "logs/covariance/{experiment}.log",
    benchmark:
        "logs/benchmark/covariance/{experiment}.tsv"
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("covariance"),
        prior=PRIOR_FLAGS,
        noise=SEQUENCES.noise_of,
    message:
        "Computing covariances of {wildcards.experiment}"
    shell:
        "python -m vigauge_paper.commands.covariance --problems {input.problems:q} --states {input.states:q}"
        " {params.prior} --noise {params.noise:q} --output {output.covariance:q} --distances"
        " {output.distances:q} --stamps {input.stamps:q} --stamp {output.stamp:q} &> {log:q}"


rule time_simulation:
    input:
        **reads(problems=CONFIGURATIONS),
    output:
        timing="data/timing/simulation.csv",
        machine="data/timing/simulation.json",
        stamp="data/timing/simulation.stamp.json",
    log:
        "logs/time_simulation.log",
    conda:
        "../envs/vigauge.yaml"
    resources:
        **ALONE,
        runtime=120,
    params:
        code=code_of("time_solves"),
        problems=parameters.named("problems", CONFIGURATIONS),
        prior=PRIOR_FLAGS,
        solver=section("solver"),
        noise="{}",
        repeats=config["timing"]["repeats_simulation"],
    message:
        "Timing all simulated configurations"
    shell:
        "python -m vigauge_paper.commands.time_solves --problems {params.problems:q} {params.prior} --solver"
        " {params.solver:q} --noise {params.noise:q} --repeats {params.repeats} --timing {output.timing:q}"
        " --machine {output.machine:q} --stamps {input.stamps:q} --stamp {output.stamp:q} &> {log:q}"


use rule time_simulation as time_sequences with:
    input:
        **reads(problems=PAPER_SEQUENCES),
    output:
        timing=f"data/timing/{SEQUENCES.source}.csv",
        machine=f"data/timing/{SEQUENCES.source}.json",
        stamp=f"data/timing/{SEQUENCES.source}.stamp.json",
    log:
        "logs/time_sequences.log",
    params:
        problems=parameters.named("problems", PAPER_SEQUENCES),
        noise=json.dumps({name: SEQUENCES.entries[name]["noise"] for name in PAPER_SEQUENCES}, sort_keys=True),
        repeats=config["timing"]["repeats_sequence"],
    message:
        "Timing the image sequences"


rule prior_sweep:
    input:
        **reads(problems=[SWEEP], truths=[SWEEP]),
    output:
        sweep="data/prior_sweep/sweep.csv",
        trace="data/prior_sweep/trace.csv",
        stamp="data/prior_sweep/stamp.json",
    log:
        "logs/prior_sweep.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("prior_sweep"),
        weights=config["prior"]["sweep_weights"],
        solver=section("solver"),
    message:
        "Solving under a range of prior weights"
    shell:
        "python -m vigauge_paper.commands.prior_sweep --problems {input.problems:q} --truth {input.truths:q}"
        " --weights {params.weights} --solver {params.solver:q} --sweep {output.sweep:q}"
        " --trace {output.trace:q} --stamps {input.stamps:q} --stamp {output.stamp:q} &> {log:q}"


rule time_sweep:
    input:
        **reads(problems=[SWEEP]),
    output:
        timing="data/timing/prior_sweep.csv",
        stamp="data/timing/prior_sweep.stamp.json",
    log:
        "logs/time_sweep.log",
    conda:
        "../envs/vigauge.yaml"
    resources:
        **ALONE,
        runtime=120,
    params:
        code=code_of("time_sweep"),
        weights=config["prior"]["sweep_weights"],
        repeats=config["timing"]["repeats_sweep"],
        solver=section("solver"),
    message:
        "Timing the range of prior weights"
    shell:
        "python -m vigauge_paper.commands.time_sweep --problems {input.problems:q} --weights {params.weights}"
        " --repeats {params.repeats} --solver {params.solver:q} --timing {output.timing:q}"
        " --stamps {input.stamps:q} --stamp {output.stamp:q} &> {log:q}"
