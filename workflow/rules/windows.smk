"""Windows of every recording, through everything: a target of its own, `snakemake --cores 2 windows`."""


wildcard_constraints:
    window="|".join(re.escape(name) for name in WINDOWS),


localrules:
    windows,


rule windows:
    input:
        f"{OUT}/windows.csv",


rule window:
    input:
        sequence=window_files,
        code=code_of("window"),
    output:
        "data/windows/{window}.csv",
    log:
        "logs/windows/{window}.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        folder=window_folder,
        truth=lambda wildcards: window_truth(wildcards, "truth"),
        biases=lambda wildcards: window_truth(wildcards, "biases"),
        settings=window_settings,
        noise=lambda wildcards: sequence_section(window_sequence(wildcards), "noise"),
        information=PRIOR_INFORMATION,
        solver=section("solver"),
    message:
        "Window {wildcards.window}"
    shell:
        "python -m vigauge_paper.commands.window --name {wildcards.window} --sequence {params.folder:q}"
        " --truth {params.truth:q} --biases {params.biases:q} --settings {params.settings:q}"
        " --noise {params.noise:q} --prior-information {params.information} --solver {params.solver:q}"
        " --output {output:q} --log {log:q}"


rule windows_table:
    input:
        rows=expand("data/windows/{window}.csv", window=WINDOWS),
        code=code_of("windows"),
    output:
        csv=f"{OUT}/windows.csv",
        md=f"{OUT}/windows.md",
        summary=f"{OUT}/windows_summary.csv",
    log:
        "logs/windows/table.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        source=SOURCE_OF_SEQUENCES,
    message:
        "Windows of all recordings"
    shell:
        "python -m vigauge_paper.commands.windows --rows {input.rows:q} --source {params.source}"
        " --output {output.csv:q} --summary {output.summary:q} --log {log:q}"
