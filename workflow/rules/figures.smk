"""Figures of the paper and ours: a rule a drawing, with the numbers that it shows beside the image."""

for drawing in DRAWINGS:

    rule:
        name:
            drawing.name
        input:
            **reads_of(drawing),
            published=published(*drawing.published),
        output:
            **{flag: figure_image(key, drawing.source) for flag, key in drawing.figures.items()},
            beside=[beside_image(key) for key in drawing.figures.values()],
        log:
            f"logs/paper/{drawing.name}.log",
        conda:
            "../envs/vigauge.yaml"
        params:
            **({"source": drawing.source} if drawing.source else {}),
            code=code_of(drawing.command),
            command=drawing.command,
            settings=drawing.settings_line,
            files=drawing.files_line,
            images=drawing.images_line,
            published=drawing.published,
        message:
            drawing.title
        shell:
            "python -m vigauge_paper.commands.{params.command} {params.files} {params.settings} {params.images}"
            " --stamps {input.stamps:q} &> {log:q}"
