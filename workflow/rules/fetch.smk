"""EuRoC from the sources of a table, when asked for; the default target never fetches."""


localrules:
    fetch_euroc,


rule fetch_euroc:
    input:
        expand("{folder}/{fetched}.json", folder=DOWNLOAD, fetched=FETCHED),


# No code among the inputs: gigabytes are not fetched anew for an edit.
rule fetch_sequence:
    output:
        record=f"{DOWNLOAD}/{{fetched}}.json",
    log:
        "logs/fetch/{fetched}.log",
    conda:
        "../envs/vigauge.yaml"
    threads: WHOLE_MACHINE  # one download at a time: hosts refuse several
    params:
        sources=EUROC_SOURCES,
        folder=folder_of_output,
    message:
        "Fetching {wildcards.fetched}"
    shell:
        "python -m vigauge_paper.commands.fetch_euroc --sequence {wildcards.fetched:q} --sources {params.sources:q}"
        " --output {params.folder:q} --record {output.record:q} &> {log:q}"
