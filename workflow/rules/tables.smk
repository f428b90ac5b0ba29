"""Tables I to III of the paper, each as CSV, Markdown and LaTeX."""


rule table1:
    input:
        **reads(covariances=[SWEEP]),
    output:
        csv=in_report("table1.csv", "Tables", TABLES["table1"], "sizes and ranks"),
        other=multiext(f"{OUT}/table1", ".md", ".tex"),
    log:
        "logs/paper/table1.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("tables"),
    message:
        "Table I"
    shell:
        "python -m vigauge_paper.commands.tables --table 1 --covariance {input.covariances:q}"
        " --output {output.csv:q} --stamps {input.stamps:q} &> {log:q}"


rule table2:
    input:
        **reads(solutions=CONFIGURATIONS),
        published=published_if_shown("table2.csv"),
    output:
        csv=in_report("table2.csv", "Tables", TABLES["table2"], "errors"),
        other=multiext(f"{OUT}/table2", ".md", ".tex"),
    log:
        "logs/paper/table2.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("tables"),
        solutions=parameters.named("solutions", CONFIGURATIONS),
        published=parameters.folder_of_published,
    message:
        "Table II"
    shell:
        "python -m vigauge_paper.commands.tables --table 2 --solutions {params.solutions:q} {params.published}"
        " --output {output.csv:q} --stamps {input.stamps:q} &> {log:q}"


rule table3:
    input:
        **reads(reports=SEQUENCES.names, solutions=SEQUENCES.names),
        errors=f"{OUT}/{FIGURES['fig_errors'].stem}.csv",
        published=published_if_shown("table3.csv"),
    output:
        csv=in_report("table3.csv", "Tables", TABLES["table3"], "errors", SEQUENCES.source),
        other=multiext(f"{OUT}/table3", ".md", ".tex"),
    log:
        "logs/paper/table3.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("tables"),
        solutions=parameters.named("solutions", SEQUENCES.names),
        reports=parameters.named("reports", SEQUENCES.names),
        names=PUBLISHED_NAMES,
        published=parameters.folder_of_published,
        source=SEQUENCES.source,
        spread=where_made("--spread", rules.spread_table.output.csv),
        spread_digest=digest_where_made(rules.spread_table.output.csv),
    message:
        "Table III"
    shell:
        "python -m vigauge_paper.commands.tables --table 3 --solutions {params.solutions:q} {params.published}"
        " --reports {params.reports:q} --published-names {params.names:q} --errors {input.errors:q}"
        " {params.spread} --source {params.source}"
        " --output {output.csv:q} --stamps {input.stamps:q} &> {log:q}"
