"""Image sequences (Section VII): EuRoC where it is, else a rendered stand-in; and the front-end."""


rule render:
    output:
        folder=directory("data/rendered/rendered_{scene}/mav0"),
        about="data/rendered/rendered_{scene}/rendered.json",
        stamp="data/rendered/rendered_{scene}/stamp.json",
    log:
        "logs/render/{scene}.log",
    wildcard_constraints:
        scene=names_of(config["rendered"]),
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("render"),
        into=parameters.folder_above_output,
        settings=lambda wildcards: section("rendered", wildcards.scene, "scene"),
    message:
        "Rendering the stand-in {wildcards.scene} (not EuRoC)"
    shell:
        "python -m vigauge_paper.commands.render --scene {wildcards.scene} --output {params.into:q}"
        " --settings {params.settings:q} --stamp {output.stamp:q} &> {log:q}"


rule check_sequence:
    input:
        parameters.of_sequence(SEQUENCES.files),
    output:
        "data/checks/{sequence}.json",
    log:
        "logs/check/{sequence}.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("check_sequence"),
        folder=parameters.of_sequence(SEQUENCES.folder),
        truths=parameters.of_sequence(SEQUENCES.truth_names),
        flags=parameters.of_sequence(SEQUENCES.check_flags),
    message:
        "Checking {wildcards.sequence}"
    shell:
        "python -m vigauge.cli.check_sequence {params.folder:q} --truth {params.truths:q} {params.flags}"
        " --output {output:q} &> {log:q}"


checkpoint front_end:
    input:
        parameters.of_sequence(SEQUENCES.files),
        checked=parameters.of_sequence(SEQUENCES.check),
        stamps=parameters.of_sequence(SEQUENCES.stamps),
    output:
        problems="data/sequences/{sequence}/problem.npz",
        truth="data/sequences/{sequence}/truth.npz",
        report="data/sequences/{sequence}/report.json",
        stamp="data/sequences/{sequence}/stamp.json",
    log:
        "logs/front_end/{sequence}.log",
    benchmark:
        "logs/benchmark/front_end/{sequence}.tsv"
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("front_end"),
        folder=parameters.of_sequence(SEQUENCES.folder),
        truth=parameters.of_sequence(SEQUENCES.truth),
        biases=parameters.of_sequence(SEQUENCES.biases),
        settings=parameters.of_sequence(SEQUENCES.front_end),
        sort=parameters.of_sequence(SEQUENCES.sort_flag),
        accepts=SEQUENCES.accepts_of,
    message:
        "Running the front-end on {wildcards.sequence}"
    shell:
        "python -m vigauge_paper.commands.front_end --sequence {params.folder:q} --biases {params.biases:q}"
        " --truth {params.truth:q} --settings {params.settings:q} {params.sort} {params.accepts}"
        " --output {output.problems:q} --truth-output {output.truth:q} --report {output.report:q}"
        " --stamps {input.stamps:q} --stamp {output.stamp:q} &> {log:q}"
