"""Tables and figures: a rule each, from a typed list of what a command reads and makes."""

ARTEFACTS = artefacts(config, SEQUENCES, rules.spread.output.csv)

for artefact in ARTEFACTS:

    rule:
        name:
            artefact.name
        input:
            **reads_of(artefact),
            published=published(*artefact.published),
        output:
            **{flag: shown(key, artefact.source) for flag, key in artefact.shows.items()},
            beside=[beside(key) for key in artefact.shows.values()],
        log:
            f"logs/paper/{artefact.name}.log",
        conda:
            "../envs/vigauge.yaml"
        params:
            **({"source": artefact.source} if artefact.source else {}),
            code=code_of(artefact.command),
            command=artefact.command,
            settings=artefact.settings_line,
            files=artefact.files_line,
            aside=[where_made(flag, table) for flag, table in artefact.aside.items()],
            aside_digest=[digest_where_made(table) for table in artefact.aside.values()],
            outputs=artefact.outputs_line,
        message:
            artefact.title
        shell:
            "python -m vigauge_paper.commands.{params.command} {params.files} {params.settings} {params.aside}"
            " {params.outputs} --stamps {input.stamps:q} &> {log:q}"
