"""EuRoC from the sources of a table, when asked for; the default target never fetches."""

FETCHED = sorted({entry["folder"] for entry in config["euroc"]["sequences"].values()})


rule fetch_euroc:
    input:
        expand("{folder}/{fetched}.json", folder=config["euroc"]["download"], fetched=FETCHED),


# No code among the parameters: gigabytes are not fetched anew for an edit, nor for one of the table.
rule fetch_sequence:
    input:
        sources=ancient(local(os.path.relpath(ROOT / "data/euroc_sources.csv"))),
    output:
        record=f"{config['euroc']['download']}/{{fetched}}.json",
    log:
        "logs/fetch/{fetched}.log",
    wildcard_constraints:
        fetched=names_of(FETCHED),
    conda:
        "../envs/vigauge.yaml"
    resources:
        downloads=1,  # at a time, by the profile: hosts refuse several
        runtime=600,
    params:
        folder=parameters.folder_of_output,
    message:
        "Fetching {wildcards.fetched}"
    shell:
        "python -m vigauge_paper.commands.fetch_euroc --sequence {wildcards.fetched:q} --sources {input.sources:q}"
        " --output {params.folder:q} --record {output.record:q} &> {log:q}"
