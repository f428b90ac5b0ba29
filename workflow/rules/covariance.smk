"""Covariances in every gauge and the transformation between them (Section VI)."""


rule covariance_simulation:
    input:
        problems="data/simulation/{configuration}/problems.npz",
        states="data/solutions/{configuration}/states.npz",
        stamps=["data/simulation/{configuration}/stamp.json", "data/solutions/{configuration}/stamp.json"],
        code=code_of("covariance"),
    output:
        covariance="data/covariance/{configuration}.npz",
        distances="data/covariance/{configuration}.csv",
        stamp="data/covariance/{configuration}.stamp.json",
    log:
        "logs/covariance/{configuration}.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        prior=PRIOR_FLAGS,
    message:
        "Covariances of {wildcards.configuration}"
    shell:
        "python -m vigauge_paper.commands.covariance --problems {input.problems:q} --states {input.states:q}"
        " {params.prior} --output {output.covariance:q} --distances {output.distances:q} --stamps {input.stamps:q} --stamp {output.stamp:q} &> {log:q}"


rule covariance_sequence:
    input:
        problems="data/sequences/{sequence}/problem.npz",
        states="data/solutions/{sequence}/states.npz",
        stamps=["data/sequences/{sequence}/stamp.json", "data/solutions/{sequence}/stamp.json"],
        code=code_of("covariance"),
    output:
        covariance="data/covariance/{sequence}.npz",
        distances="data/covariance/{sequence}.csv",
        stamp="data/covariance/{sequence}.stamp.json",
    log:
        "logs/covariance/{sequence}.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        prior=PRIOR_FLAGS,
        noise=noise_models,
    message:
        "Covariances of {wildcards.sequence}"
    shell:
        "python -m vigauge_paper.commands.covariance --problems {input.problems:q} --states {input.states:q}"
        " {params.prior} --noise {params.noise:q} --output {output.covariance:q} --distances {output.distances:q} --stamps {input.stamps:q} --stamp {output.stamp:q} &> {log:q}"


rule explorer:
    input:
        problems=explored_problems,
        truth=explored_truth,
        states="data/solutions/{estimate}/states.npz",
        covariance="data/covariance/{estimate}.npz",
        stamps=explored_stamps,
        code=code_of("explorer"),
    output:
        "data/explorer/{estimate}.json",
    log:
        "logs/explorer/{estimate}.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        noise=explored_noise,
    message:
        "{wildcards.estimate} for the gauge explorer"
    shell:
        "python -m vigauge_paper.commands.explorer --name {wildcards.estimate} --problems {input.problems:q}"
        " --truth {input.truth:q} --states {input.states:q} --covariance {input.covariance:q} --noise {params.noise:q}"
        " --output {output:q} --stamps {input.stamps:q} &> {log:q}"
