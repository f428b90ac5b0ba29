"""The ledger of the paper's claims, the comparison with its numbers, and what all was made with."""

IMAGES = {key: f"{OUT}/{figure.stem}.png" for key, figure in FIGURES.items()}
REASONS = dict(zip(EXPLAINING, made("reasons", EXPLAINING)))
# What shows a claim: names as the ledger has them.
SHOWING = {"claims_statistics": f"{OUT}/claims_statistics.csv", **REASONS}
EVIDENCE = {**{table: f"{OUT}/{table}.csv" for table in TABLES}, **IMAGES, **SHOWING}
# What claims and comparison judge.
JUDGED = {
    **{kind: EXPERIMENTS for kind in ("solutions", "covariances", "timings")},
    **{kind: [SWEEP] for kind in ("sweep", "sweep_trace")},
}
# Only made when asked for, and shown where someone has.
SENSITIVITY = rules.sensitivity.output.summary
WINDOWS = rules.windows.output.md
NO_TRUTH = rules.no_truth.output.md
SUMMARISED = ["table2", "table3", FIGURES["fig07"].stem, FIGURES["fig11"].stem]


rule environment:
    input:
        **reads(machines=[SWEEP, PAPER_SEQUENCES[0]], reports=SEQUENCES.names),
    output:
        in_report("environment.json", "Environment", "Environment", "versions and machine", SEQUENCES.source),
    log:
        "logs/paper/environment.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("environment"),
        config=used_configuration(config, SEQUENCES),
        checkout=os.path.relpath(ROOT),
        source=SEQUENCES.source,
        reports=parameters.named("reports", SEQUENCES.names),
    message:
        "Recording versions, machine and configuration"
    shell:
        "python -m vigauge_paper.commands.environment --config {params.config:q} --checkout {params.checkout:q}"
        " --source {params.source} --reports {params.reports:q} --timings {input.machines:q}"
        " --output {output:q} --stamps {input.stamps:q} &> {log:q}"


rule claims:
    input:
        **reads(**JUDGED, machines=[SWEEP], reasons=EXPLAINING),
    output:
        csv=in_report("claims.csv", "Claims", "Claims", "verdicts", SEQUENCES.source_of_claims),
        md=f"{OUT}/claims.md",
        why=in_report("claims_why.csv", "Claims", "Claims", "reasons", SEQUENCES.source_of_claims),
        statistics=in_report("claims_statistics.csv", "Claims", "Claims", "statistics"),
    log:
        "logs/paper/claims.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("claims"),
        solutions=parameters.named("solutions", EXPERIMENTS),
        timings=parameters.named("timings", EXPERIMENTS),
        covariances=parameters.named("covariances", EXPERIMENTS),
        reasons=parameters.named("reasons", EXPLAINING),
        sweep_configuration=SWEEP,
        machine_hall=SEQUENCES.machine_hall,
        vicon_room=SEQUENCES.vicon_room,
        source=SEQUENCES.source_of_claims,
        criteria=section("claims"),
        reading=READING,
        evidence=parameters.from_the_output(EVIDENCE),
        sensitivity=where_made("sensitivity", SENSITIVITY),
        sensitivity_digest=digest_where_made(SENSITIVITY),
    message:
        "Judging the paper's claims"
    shell:
        "python -m vigauge_paper.commands.claims --solutions {params.solutions:q} --timings {params.timings:q}"
        " --covariances {params.covariances:q} --reasons {params.reasons:q} --sweep {input.sweep:q}"
        " --sweep-trace {input.sweep_trace:q} --sweep-configuration {params.sweep_configuration}"
        " --machine-hall {params.machine_hall} --vicon-room {params.vicon_room} --source {params.source}"
        " --machine {input.machines:q} --criteria {params.criteria:q} --prior-reading {params.reading}"
        " --output {output.csv:q} --why {output.why:q} --statistics {output.statistics:q}"
        " --evidence {params.evidence:q} {params.sensitivity} --stamps {input.stamps:q} &> {log:q}"


rule explorer:
    input:
        unpack(results_of("problems", "truths", "states", "covariances")),
    output:
        "data/explorer/{experiment}.json",
    log:
        "logs/explorer/{experiment}.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("explorer"),
        noise=SEQUENCES.noise_of,
    message:
        "Preparing {wildcards.experiment} for the gauge explorer"
    shell:
        "python -m vigauge_paper.commands.explorer --name {wildcards.experiment} --problems {input.problems:q}"
        " --truth {input.truths:q} --states {input.states:q} --covariance {input.covariances:q}"
        " --noise {params.noise:q} --output {output:q} --stamps {input.stamps:q} &> {log:q}"


rule index:
    input:
        images=list(IMAGES.values()),
        narrow=list(NARROW.values()),
        evidence=list(SHOWING.values()),
        biases=rules.biases.output.md,
        tables=[f"{OUT}/{table}.md" for table in TABLES],
        claims=rules.claims.output.csv,
        ledger=rules.claims.output.md,
        why=rules.claims.output.why,
        environment=rules.environment.output,
        explorers=expand(rules.explorer.output, experiment=[SWEEP, *PAPER_SEQUENCES]),
        captions=[local(os.path.relpath(ROOT / f"workflow/report/{key}.rst")) for key in FIGURES],
        stamps=reads(problems=PAPER_SEQUENCES, solutions=PAPER_SEQUENCES)["stamps"],
    output:
        in_report("index.html", "Claims", "Claims", "page with the evidence", SEQUENCES.source_of_claims),
    log:
        "logs/paper/index.log",
    localrule: True  # takes a moment, after everything else
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("index"),
        captions=parameters.folder_of("captions"),
        tables=parameters.named("tables", TABLES),
        figures=parameters.named("images", IMAGES),
        evidence=parameters.named("evidence", SHOWING),
        published=[key for a in ARTEFACTS for key in a.shows.values() if a.published and key in FIGURES],
        extensions=lambda wildcards, input: [
            f"Biases in the state={input.biases}",
            *BUILDS.extensions(
                {"Other parts of the recordings": WINDOWS, "Without any ground truth": NO_TRUTH}
            ),
        ],
        spread=where_made("spread", rules.spread.output.csv),
        extensions_digest=[digest_where_made(table) for table in (WINDOWS, NO_TRUTH, rules.spread.output.csv)],
        source=SEQUENCES.source_of_claims,
    message:
        "Writing index.html, the page to open first"
    shell:
        "python -m vigauge_paper.commands.index --claims {input.claims:q} --why {input.why:q}"
        " --environment {input.environment:q} --captions {params.captions:q} --tables {params.tables:q}"
        " --figures {params.figures:q} --evidence {params.evidence:q} --published {params.published:q}"
        " --extensions {params.extensions:q} {params.spread} --explorers {input.explorers:q}"
        " --source {params.source} --output {output:q} --stamps {input.stamps:q} &> {log:q}"


rule comparison:
    input:
        **reads(**JUDGED, problems=[SWEEP], sweep_timing=[SWEEP], reasons=["bias_hypothesis"]),
        published=published(
            *("table2.csv", "table3.csv", "fig09.npz", "fig10.npz"),
            *(f"{FIGURES[key].stem}.csv" for key in ("fig01", "fig04", "fig05", "fig06", "fig07", "fig11")),
        ),
    output:
        csv=in_report("comparison.csv", "Claims", "Comparison", "all numbers", SEQUENCES.source_of_claims),
        md=f"{OUT}/comparison.md",
    log:
        "logs/paper/comparison.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("comparison"),
        solutions=parameters.named("solutions", EXPERIMENTS),
        timings=parameters.named("timings", EXPERIMENTS),
        covariances=parameters.named("covariances", EXPERIMENTS),
        published=parameters.folder_of_published,
        reading=READING,
        solver=section("solver"),
        seed=config["claims"]["seed"],
        source=SEQUENCES.source_of_claims,
        names=PUBLISHED_NAMES if SEQUENCES.are_published else [],
        sensitivity=where_made("sensitivity", SENSITIVITY),
        sensitivity_digest=digest_where_made(SENSITIVITY),
    message:
        "Comparing the published numbers with ours"
    shell:
        "python -m vigauge_paper.commands.comparison --solutions {params.solutions:q} --timings {params.timings:q}"
        " --covariances {params.covariances:q} --sweep {input.sweep:q} --sweep-timing {input.sweep_timing:q}"
        " --sweep-trace {input.sweep_trace:q} --problems {input.problems:q} --prior-reading {params.reading}"
        " --solver {params.solver:q} --hypothesis {input.reasons:q} {params.published} --seed {params.seed}"
        " --source {params.source} --published-names {params.names:q} {params.sensitivity}"
        " --output {output.csv:q} --stamps {input.stamps:q} &> {log:q}"


rule summary:
    input:
        expand("{folder}/{name}.csv", folder=OUT, name=[*SUMMARISED, "claims"]),
        expand("{folder}/{name}.md", folder=OUT, name=["table2", "table3"]),
        published=published(*(f"{name}.csv" for name in SUMMARISED)),
    output:
        f"{OUT}/summary.md",
    log:
        "logs/paper/summary.log",
    localrule: True  # takes a moment, after everything else
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("summary"),
        artefacts=parameters.folder_of_output,
        published=parameters.folder_of_published,
        source=SEQUENCES.source,
        names=PUBLISHED_NAMES,
    message:
        "Writing the summary of paper and reproduction"
    shell:
        "python -m vigauge_paper.commands.summary --artefacts {params.artefacts:q} {params.published}"
        " --source {params.source} --published-names {params.names:q} --output {output:q} &> {log:q}"


rule paper_page:
    input:
        rules.summary.output,
    output:
        touch("data/paper_page.done"),
    log:
        "logs/paper/paper_page.log",
    localrule: True  # takes a moment, after everything else
    conda:
        "../envs/vigauge.yaml"
    params:
        code=code_of("paper_page"),
        page=os.path.relpath(ROOT / "docs/paper.md"),
    message:
        "Putting the summary into docs/paper.md"
    shell:
        "python -m vigauge_paper.commands.paper_page --summary {input:q} --page {params.page:q} &> {log:q}"
