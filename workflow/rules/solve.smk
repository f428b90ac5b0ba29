"""Solves in the three gauges (Section V): for their outcome, and again for their time, with the machine alone."""


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
        stamp="data/solutions/{configuration}/stamp.json",
    log:
        "logs/solve/{configuration}.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        prior=PRIOR_FLAGS,
        solver=section("solver"),
    message:
        "Solving {wildcards.configuration} in three gauges"
    shell:
        "python -m vigauge_paper.commands.solve --problems {input.problems:q} --truth {input.truth:q}"
        " {params.prior} --solver {params.solver:q}"
        " --solutions {output.solutions:q} --trace {output.trace:q} --states {output.states:q}"
        " --stamps {input.stamp:q} --stamp {output.stamp:q} &> {log:q}"


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
        stamp="data/solutions/{sequence}/stamp.json",
    log:
        "logs/solve/{sequence}.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        prior=PRIOR_FLAGS,
        solver=section("solver"),
        noise=noise_models,
    message:
        "Solving {wildcards.sequence} in three gauges"
    shell:
        "python -m vigauge_paper.commands.solve --problems {input.problems:q} --truth {input.truth:q}"
        " {params.prior} --solver {params.solver:q} --noise {params.noise:q}"
        " --solutions {output.solutions:q} --trace {output.trace:q} --states {output.states:q}"
        " --stamps {input.stamp:q} --stamp {output.stamp:q} &> {log:q}"


rule time_simulation:
    input:
        problems=expand("data/simulation/{name}/problems.npz", name=CONFIGURATIONS),
        stamps=expand("data/simulation/{name}/stamp.json", name=CONFIGURATIONS),
        code=code_of("time_solves"),
    output:
        timing="data/timing/simulation.csv",
        machine="data/timing/simulation.json",
        stamp="data/timing/simulation.stamp.json",
    log:
        "logs/time_simulation.log",
    conda:
        "../envs/vigauge.yaml"
    threads: WHOLE_MACHINE
    params:
        problems=expand("{name}=data/simulation/{name}/problems.npz", name=CONFIGURATIONS),
        prior=PRIOR_FLAGS,
        solver=section("solver"),
        repeats=config["timing"]["repeats_simulation"],
    message:
        "Timing all simulated configurations"
    shell:
        "python -m vigauge_paper.commands.time_solves --problems {params.problems:q}"
        " {params.prior} --solver {params.solver:q} --repeats {params.repeats}"
        " --timing {output.timing:q} --machine {output.machine:q} --stamps {input.stamps:q} --stamp {output.stamp:q} &> {log:q}"


rule time_sequences:
    input:
        problems=expand("data/sequences/{name}/problem.npz", name=PAPER_SEQUENCES),
        stamps=expand("data/sequences/{name}/stamp.json", name=PAPER_SEQUENCES),
        code=code_of("time_solves"),
    output:
        timing=f"data/timing/{SOURCE_OF_SEQUENCES}.csv",
        machine=f"data/timing/{SOURCE_OF_SEQUENCES}.json",
        stamp=f"data/timing/{SOURCE_OF_SEQUENCES}.stamp.json",
    log:
        "logs/time_sequences.log",
    conda:
        "../envs/vigauge.yaml"
    threads: WHOLE_MACHINE
    params:
        problems=expand("{name}=data/sequences/{name}/problem.npz", name=PAPER_SEQUENCES),
        prior=PRIOR_FLAGS,
        solver=section("solver"),
        noise=json.dumps({name: ENTRIES[name]["noise"] for name in PAPER_SEQUENCES}, sort_keys=True),
        repeats=config["timing"]["repeats_sequence"],
    message:
        "Timing the image sequences"
    shell:
        "python -m vigauge_paper.commands.time_solves --problems {params.problems:q}"
        " {params.prior} --solver {params.solver:q} --noise {params.noise:q} --repeats {params.repeats}"
        " --timing {output.timing:q} --machine {output.machine:q} --stamps {input.stamps:q} --stamp {output.stamp:q} &> {log:q}"


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
        repeats=config["timing"]["repeats_sweep"],
        solver=section("solver"),
    message:
        "Solving under a range of prior weights"
    shell:
        "python -m vigauge_paper.commands.prior_sweep --problems {input.problems:q} --truth {input.truth:q}"
        " --weights {params.weights} --repeats {params.repeats} --solver {params.solver:q}"
        " --sweep {output.sweep:q} --trace {output.trace:q} --timing {output.timing:q} --stamps {input.stamp:q} --stamp {output.stamp:q} &> {log:q}"
