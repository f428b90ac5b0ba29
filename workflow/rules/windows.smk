"""Other parts of the recordings, as sequences of their own: `snakemake --cores 2 windows`."""


localrules:
    windows,


rule windows:
    input:
        f"{OUT}/windows.csv",


rule windows_table:
    input:
        expand("data/checks/{name}.json", name=WINDOWS),
        expand("data/sequences/{name}/report.json", name=WINDOWS),
        solved=results_of_windows,
        stamps=stamps_of_windows,
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
        windows=settings_of_windows,
        source=SOURCE_OF_SEQUENCES,
    message:
        "Windows of all recordings"
    shell:
        "python -m vigauge_paper.commands.windows --windows {params.windows:q} --data data --source {params.source}"
        " --output {output.csv:q} --summary {output.summary:q} --stamps {input.stamps:q} &> {log:q}"
