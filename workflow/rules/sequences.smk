"""Image sequences (Section VII): EuRoC where it is, else a rendered stand-in; and the front-end."""


rule render:
    input:
        code=code_of("render"),
    output:
        folder=directory("data/rendered/rendered_{scene}/mav0"),
        about="data/rendered/rendered_{scene}/rendered.json",
        stamp="data/rendered/rendered_{scene}/stamp.json",
    log:
        "logs/render/{scene}.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        settings=scene_settings,
    message:
        "Rendering the stand-in {wildcards.scene} (not EuRoC)"
    shell:
        "python -m vigauge_paper.commands.render --scene {wildcards.scene} --output data/rendered"
        " --settings {params.settings:q} --stamp {output.stamp:q} &> {log:q}"


rule check_sequence:
    input:
        sequence=sequence_files,
        code=code_of("check_sequence"),
    output:
        "data/checks/{sequence}.json",
    log:
        "logs/check/{sequence}.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        folder=front_end_folder,
        truths=truth_names,
        window=check_window,
        sort=sort_flag,
        accepts=check_accepts,
    message:
        "Checking {wildcards.sequence}"
    shell:
        "python -m vigauge.cli.check_sequence {params.folder:q} --truth {params.truths:q} {params.window}"
        " {params.sort} {params.accepts} --output {output:q} &> {log:q}"


checkpoint front_end:
    input:
        checked="data/checks/{sequence}.json",
        sequence=sequence_files,
        stamps=stamps_of_sequence,
        code=code_of("front_end"),
    output:
        problem="data/sequences/{sequence}/problem.npz",
        truth="data/sequences/{sequence}/truth.npz",
        report="data/sequences/{sequence}/report.json",
        stamp="data/sequences/{sequence}/stamp.json",
    log:
        "logs/front_end/{sequence}.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        folder=front_end_folder,
        truth=front_end_truth,
        biases=front_end_biases,
        settings=front_end_settings,
        sort=sort_flag,
        accepts=front_end_accepts,
    message:
        "Front-end on {wildcards.sequence}"
    shell:
        "python -m vigauge_paper.commands.front_end --sequence {params.folder:q} --biases {params.biases:q}"
        " --truth {params.truth:q} --settings {params.settings:q} {params.sort} {params.accepts} --output {output.problem:q}"
        " --truth-output {output.truth:q} --report {output.report:q} --stamps {input.stamps:q} --stamp {output.stamp:q} &> {log:q}"
