"""Solves in the three gauges (Section V). They are timed, so each has the machine to itself."""


rule solve_simulation:
    input:
        problems="data/simulation/{configuration}/problems.npz",
        truth="data/simulation/{configuration}/truth.npz",
        stamp="data/simulation/{configuration}/stamp.json",
        code=code_of("solve"),
    output:
        solutions="data/solutions/{configuration}/solutions.csv",
        trace="data/solutions/{configuration}/trace.csv",
        states="data/solutions/{configuration}/states.npz",
        timing="data/solutions/{configuration}/timing.csv",
        machine="data/solutions/{configuration}/timing.json",
        stamp="data/solutions/{configuration}/stamp.json",
    log:
        "logs/solve/{configuration}.log",
    conda:
        "../envs/vigauge.yaml"
    threads: WHOLE_MACHINE
    params:
        prior=PRIOR_FLAGS,
        solver=section("solver"),
        repeats=config["timing"]["repeats_simulation"],
    message:
        "Solving {wildcards.configuration} in three gauges"
    shell:
        "python -m vigauge_paper.commands.solve --problems {input.problems:q} --truth {input.truth:q}"
        " {params.prior} --solver {params.solver:q} --repeats {params.repeats}"
        " --solutions {output.solutions:q} --trace {output.trace:q} --states {output.states:q}"
        " --timing {output.timing:q} --machine {output.machine:q} --stamps {input.stamp:q} --stamp {output.stamp:q} --log {log:q}"


rule solve_sequence:
    input:
        problems="data/sequences/{sequence}/problem.npz",
        truth="data/sequences/{sequence}/truth.npz",
        stamp="data/sequences/{sequence}/stamp.json",
        code=code_of("solve"),
    output:
        solutions="data/solutions/{sequence}/solutions.csv",
        trace="data/solutions/{sequence}/trace.csv",
        states="data/solutions/{sequence}/states.npz",
        timing="data/solutions/{sequence}/timing.csv",
        machine="data/solutions/{sequence}/timing.json",
        stamp="data/solutions/{sequence}/stamp.json",
    log:
        "logs/solve/{sequence}.log",
    conda:
        "../envs/vigauge.yaml"
    threads: WHOLE_MACHINE
    params:
        prior=PRIOR_FLAGS,
        solver=section("solver"),
        noise=noise_models,
        repeats=repeats_of,
    message:
        "Solving {wildcards.sequence} in three gauges"
    shell:
        "python -m vigauge_paper.commands.solve --problems {input.problems:q} --truth {input.truth:q}"
        " {params.prior} --solver {params.solver:q} --noise {params.noise:q}"
        " --repeats {params.repeats}"
        " --solutions {output.solutions:q} --trace {output.trace:q} --states {output.states:q}"
        " --timing {output.timing:q} --machine {output.machine:q} --stamps {input.stamp:q} --stamp {output.stamp:q} --log {log:q}"


rule prior_sweep:
    input:
        problems=f"data/simulation/{config['prior']['sweep_configuration']}/problems.npz",
        truth=f"data/simulation/{config['prior']['sweep_configuration']}/truth.npz",
        stamp=f"data/simulation/{config['prior']['sweep_configuration']}/stamp.json",
        code=code_of("prior_sweep"),
    output:
        sweep="data/prior_sweep/sweep.csv",
        trace="data/prior_sweep/trace.csv",
        timing="data/prior_sweep/timing.csv",
        stamp="data/prior_sweep/stamp.json",
    log:
        "logs/prior_sweep.log",
    conda:
        "../envs/vigauge.yaml"
    threads: WHOLE_MACHINE
    params:
        weights=config["prior"]["sweep_weights"],
        solver=section("solver"),
    message:
        "Solving under a range of prior weights"
    shell:
        "python -m vigauge_paper.commands.prior_sweep --problems {input.problems:q} --truth {input.truth:q}"
        " --weights {params.weights} --solver {params.solver:q}"
        " --sweep {output.sweep:q} --trace {output.trace:q} --timing {output.timing:q} --stamps {input.stamp:q} --stamp {output.stamp:q} --log {log:q}"
