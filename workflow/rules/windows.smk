"""Other parts of the recordings, as sequences of their own: `snakemake --cores 2 windows`."""


rule windows:
    input:
        checks=expand(rules.check_sequence.output, sequence=SEQUENCES.windows),
        reports=expand(rules.front_end.output.report, sequence=SEQUENCES.windows),
        solved=usable_windows("solutions", "distances"),
        stamps=usable_windows("stamps"),
    output:
        csv=f"{OUT}/windows.csv",
        md=f"{OUT}/windows.md",
        summary=f"{OUT}/windows_summary.csv",
    log:
        "logs/windows/table.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("windows"),
        windows=SEQUENCES.windows_shown(),
        source=SEQUENCES.source,
        data=parameters.folder_above("checks"),
    message:
        "Summarising the windows of all recordings"
    shell:
        "python -m vigauge_paper.commands.windows --windows {params.windows:q} --data {params.data:q}"
        " --source {params.source} --output {output.csv:q} --summary {output.summary:q}"
        " --stamps {input.stamps:q} &> {log:q}"
