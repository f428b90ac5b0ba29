"""Simulated experiments (Section IV-A)."""


rule simulate:
    input:
        code=code_of("simulate"),
    output:
        problems="data/simulation/{trajectory}_{points}/problems.npz",
        truth="data/simulation/{trajectory}_{points}/truth.npz",
        path="data/simulation/{trajectory}_{points}/path.csv",
        report="data/simulation/{trajectory}_{points}/report.json",
        stamp="data/simulation/{trajectory}_{points}/stamp.json",
    log:
        "logs/simulate/{trajectory}_{points}.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        settings=section("simulation"),
    message:
        "Simulating {wildcards.trajectory} {wildcards.points}"
    shell:
        "python -m vigauge_paper.commands.simulate --trajectory {wildcards.trajectory} --points {wildcards.points}"
        " --settings {params.settings:q} --problems {output.problems:q} --truth {output.truth:q}"
        " --path {output.path:q} --report {output.report:q} --stamp {output.stamp:q} &> {log:q}"
