"""Covariances in every gauge and the transformation between them (Section VI)."""


rule covariance_simulation:
    input:
        problems="data/simulation/{configuration}/problems.npz",
        states="data/solutions/{configuration}/states.npz",
        code=code_of("covariance"),
    output:
        "data/covariance/{configuration}.npz",
    log:
        "logs/covariance/{configuration}.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        weight=config["prior"]["weight"],
    message:
        "Covariances of {wildcards.configuration}"
    shell:
        "python -m vigauge.cli.covariance --problems {input.problems:q} --states {input.states:q}"
        " --prior-weight {params.weight} --output {output:q} --log {log:q}"


rule covariance_sequence:
    input:
        problems="data/sequences/{sequence}/problem.npz",
        states="data/solutions/{sequence}/states.npz",
        code=code_of("covariance"),
    output:
        "data/covariance/{sequence}.npz",
    log:
        "logs/covariance/{sequence}.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        weight=config["prior"]["weight"],
        noise=headline_noise,
    message:
        "Covariances of {wildcards.sequence}"
    shell:
        "python -m vigauge.cli.covariance --problems {input.problems:q} --states {input.states:q}"
        " --prior-weight {params.weight} --noise {params.noise:q} --output {output:q} --log {log:q}"
