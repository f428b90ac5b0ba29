"""Simulated experiments (Section IV-A)."""


rule simulate:
    output:
        problems="data/simulation/{configuration}/problems.npz",
        truth="data/simulation/{configuration}/truth.npz",
        path="data/simulation/{configuration}/path.csv",
        report="data/simulation/{configuration}/report.json",
        stamp="data/simulation/{configuration}/stamp.json",
    log:
        "logs/simulate/{configuration}.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("simulate"),
        scene=parameters.scene_of,
        settings=section("simulation"),
    message:
        "Simulating {wildcards.configuration}"
    shell:
        "python -m vigauge_paper.commands.simulate {params.scene} --settings {params.settings:q}"
        " --problems {output.problems:q} --truth {output.truth:q} --path {output.path:q}"
        " --report {output.report:q} --stamp {output.stamp:q} &> {log:q}"
