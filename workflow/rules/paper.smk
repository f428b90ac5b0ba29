"""Tables and figures of the paper, the ledger of its claims, and what they were made with."""

OUT = "paper_figures"
# What shows a claim: names as the ledger has them.
IMAGES = {key: f"{OUT}/{figure.stem}.png" for key, figure in FIGURES.items()}
EXPLAINING = {"claims_statistics": f"{OUT}/claims_statistics.csv", **REASON_TABLES}
EVIDENCE = {**{table: f"{OUT}/{table}.csv" for table in TABLES}, **IMAGES, **EXPLAINING}


rule environment:
    input:
        timings=expand("data/timing/{name}.json", name=["simulation", SOURCE_OF_SEQUENCES]),
        reports=expand("data/sequences/{name}/report.json", name=SEQUENCES),
        stamps=[
            *TIMING_STAMPS,
            *expand("data/sequences/{name}/stamp.json", name=SEQUENCES),
        ],
        code=code_of("environment"),
    output:
        report(f"{OUT}/environment.json", caption="../report/environment.rst", category="Environment"),
    log:
        "logs/paper/environment.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        config=whole_configuration(),
        checkout=os.path.relpath(ROOT),
        source=SOURCE_OF_SEQUENCES,
        reports=expand("{name}=data/sequences/{name}/report.json", name=SEQUENCES),
    message:
        "Recording versions, machine and configuration"
    shell:
        "python -m vigauge_paper.commands.environment --config {params.config:q} --checkout {params.checkout:q}"
        " --source {params.source} --reports {params.reports:q} --timings {input.timings:q}"
        " --output {output:q} --stamps {input.stamps:q} &> {log:q}"


rule table1:
    input:
        covariance=f"data/covariance/{config['prior']['sweep_configuration']}.npz",
        stamps=f"data/covariance/{config['prior']['sweep_configuration']}.stamp.json",
        code=code_of("tables"),
    output:
        csv=report(f"{OUT}/table1.csv", caption="../report/table1.rst", category="Tables"),
        md=f"{OUT}/table1.md",
        tex=f"{OUT}/table1.tex",
    log:
        "logs/paper/table1.log",
    conda:
        "../envs/vigauge.yaml"
    message:
        "Table I"
    shell:
        "python -m vigauge_paper.commands.tables --table 1 --covariance {input.covariance:q} --output {output.csv:q}"
        " --stamps {input.stamps:q} &> {log:q}"


rule table2:
    input:
        solutions=expand("data/solutions/{name}/solutions.csv", name=CONFIGURATIONS),
        published=published("table2"),
        stamps=expand("data/solutions/{name}/stamp.json", name=CONFIGURATIONS),
        code=code_of("tables"),
    output:
        csv=report(f"{OUT}/table2.csv", caption="../report/table2.rst", category="Tables"),
        md=f"{OUT}/table2.md",
        tex=f"{OUT}/table2.tex",
    log:
        "logs/paper/table2.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        named=expand("{name}=data/solutions/{name}/solutions.csv", name=CONFIGURATIONS),
        published=PUBLISHED_FLAG,
    message:
        "Table II"
    shell:
        "python -m vigauge_paper.commands.tables --table 2 --solutions {params.named:q} {params.published}"
        " --output {output.csv:q} --stamps {input.stamps:q} &> {log:q}"


rule table3:
    input:
        solutions=expand("data/solutions/{name}/solutions.csv", name=SEQUENCES),
        reports=expand("data/sequences/{name}/report.json", name=SEQUENCES),
        errors=f"{OUT}/{FIGURES['fig_errors'].stem}.csv",
        published=published("table3"),
        stamps=expand("data/{kind}/{name}/stamp.json", kind=["sequences", "solutions"], name=SEQUENCES),
        code=code_of("tables"),
    output:
        csv=report(f"{OUT}/table3.csv", caption="../report/table3.rst", category="Tables"),
        md=f"{OUT}/table3.md",
        tex=f"{OUT}/table3.tex",
    log:
        "logs/paper/table3.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        named=expand("{name}=data/solutions/{name}/solutions.csv", name=SEQUENCES),
        reports=expand("{name}=data/sequences/{name}/report.json", name=SEQUENCES),
        names=[f"{name}={theirs}" for name, theirs in PUBLISHED_NAMES.items()],
        published=PUBLISHED_FLAG,
        source=SOURCE_OF_SEQUENCES,
        spread=where_made("--spread", SPREAD_TABLE, SPREAD_STAMP),
        spread_digest=digest_where_made(SPREAD_TABLE),
    message:
        "Table III"
    shell:
        "python -m vigauge_paper.commands.tables --table 3 --solutions {params.named:q} {params.published}"
        " --reports {params.reports:q} --published-names {params.names:q}"
        " --errors {input.errors:q} {params.spread} --source {params.source} --output {output.csv:q} --stamps {input.stamps:q} &> {log:q}"


rule figure_ellipses:
    input:
        covariance=f"data/covariance/{MACHINE_HALL}.npz",
        second=f"data/covariance/{VICON_ROOM}.npz",
        stamps=expand("data/covariance/{name}.stamp.json", name=PAPER_SEQUENCES),
        published=published_on_sequences(f"{FIGURES['fig01'].stem}.csv"),
        code=code_of("figure_covariance"),
    output:
        png=figure_image("fig01"),
        beside=beside_image("fig01"),
    log:
        "logs/paper/fig01.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        source=SOURCE_OF_SEQUENCES,
        published=published_file_flag,
    message:
        FIGURES["fig01"].title
    shell:
        "python -m vigauge_paper.commands.figure_covariance --kind ellipses --covariance {input.covariance:q}"
        " --beside {input.second:q} --source {params.source} {params.published} --output {output.png:q} --stamps {input.stamps:q} &> {log:q}"


rule figure_orbit:
    input:
        problems=f"data/simulation/{config['prior']['sweep_configuration']}/problems.npz",
        stamps=f"data/simulation/{config['prior']['sweep_configuration']}/stamp.json",
        code=code_of("figure_orbit"),
    output:
        paths=figure_image("fig02"),
        transformation=figure_image("fig08"),
        beside_paths=beside_image("fig02"),
        beside_transformation=beside_image("fig08"),
    log:
        "logs/paper/fig02.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        solver=section("solver"),
        trial=config["figures"]["orbit_trial"],
        weight=config["figures"]["orbit_prior_weight"],
        reading=config["prior"]["reading"],
    message:
        "Figures 2 and 8"
    shell:
        "python -m vigauge_paper.commands.figure_orbit --problems {input.problems:q} --trial {params.trial}"
        " --prior-weight {params.weight} --prior-reading {params.reading} --solver {params.solver:q}"
        " --paths {output.paths:q} --transformation {output.transformation:q} --stamps {input.stamps:q} &> {log:q}"


rule figure_scenes:
    input:
        truths=expand("data/simulation/{name}/truth.npz", name=config["figures"]["scenes"]),
        paths=expand("data/simulation/{name}/path.csv", name=config["figures"]["scenes"]),
        stamps=expand("data/simulation/{name}/stamp.json", name=config["figures"]["scenes"]),
        code=code_of("figure_scenes"),
    output:
        png=figure_image("fig03"),
        beside=beside_image("fig03"),
    log:
        "logs/paper/fig03.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        names=config["figures"]["scenes"],
    message:
        FIGURES["fig03"].title
    shell:
        "python -m vigauge_paper.commands.figure_scenes --names {params.names} --truths {input.truths:q}"
        " --paths {input.paths:q} --output {output.png:q} --stamps {input.stamps:q} &> {log:q}"


rule figure_prior:
    input:
        sweep="data/prior_sweep/sweep.csv",
        timing="data/prior_sweep/timing.csv",
        trace="data/prior_sweep/trace.csv",
        published=published(*(FIGURES[key].stem for key in ("fig04", "fig05", "fig06"))),
        stamps="data/prior_sweep/stamp.json",
        code=code_of("figure_prior"),
    output:
        accuracy=figure_image("fig04"),
        cost=figure_image("fig05"),
        paths=figure_image("fig06"),
        beside_accuracy=beside_image("fig04"),
        beside_cost=beside_image("fig05"),
        beside_paths=beside_image("fig06"),
    log:
        "logs/paper/fig04.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        weights=config["figures"]["path_weights"],
        reading=config["prior"]["reading"],
        published=PUBLISHED_FLAG,
    message:
        "Figures 4, 5 and 6"
    shell:
        "python -m vigauge_paper.commands.figure_prior --sweep {input.sweep:q} --timing {input.timing:q}"
        " --trace {input.trace:q} --path-weights {params.weights} {params.published} --prior-reading {params.reading}"
        " --accuracy {output.accuracy:q} --cost {output.cost:q} --paths {output.paths:q} --stamps {input.stamps:q} &> {log:q}"


rule figure_simulation_cost:
    input:
        expand("data/solutions/{name}/solutions.csv", name=FIGURE7_ORDER),
        TIMINGS[FIGURE7_ORDER[0]],
        published=published(FIGURES["fig07"].stem),
        stamps=[*expand("data/solutions/{name}/stamp.json", name=FIGURE7_ORDER), TIMING_STAMPS[0]],
        code=code_of("figure_cost"),
    output:
        png=figure_image("fig07"),
        beside=beside_image("fig07"),
    log:
        "logs/paper/fig07.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        solutions=expand("{name}=data/solutions/{name}/solutions.csv", name=FIGURE7_ORDER),
        timings=[f"{name}={TIMINGS[name]}" for name in FIGURE7_ORDER],
        names=FIGURE7_ORDER,
        file=f"{FIGURES['fig07'].stem}.csv",
        published=PUBLISHED_FLAG,
    message:
        FIGURES["fig07"].title
    shell:
        "python -m vigauge_paper.commands.figure_cost --solutions {params.solutions:q} --timings {params.timings:q}"
        " --source simulation {params.published} --published-file {params.file}"
        " --published-names {params.names} --output {output.png:q} --stamps {input.stamps:q} &> {log:q}"


rule figure_covariance_simulation:
    input:
        covariance=f"data/covariance/{config['prior']['sweep_configuration']}.npz",
        stamps=f"data/covariance/{config['prior']['sweep_configuration']}.stamp.json",
        published=published_files("fig09.npz"),
        code=code_of("figure_covariance"),
    output:
        png=figure_image("fig09"),
        beside=beside_image("fig09"),
    log:
        "logs/paper/fig09.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        published=published_file_flag,
    message:
        FIGURES["fig09"].title
    shell:
        "python -m vigauge_paper.commands.figure_covariance --kind matrices --covariance {input.covariance:q}"
        " --source simulation {params.published} --output {output.png:q} --stamps {input.stamps:q} &> {log:q}"


rule figure_covariance_sequence:
    input:
        covariance=f"data/covariance/{VICON_ROOM}.npz",
        stamps=f"data/covariance/{VICON_ROOM}.stamp.json",
        published=published_on_sequences("fig10.npz"),
        code=code_of("figure_covariance"),
    output:
        png=figure_image("fig10"),
        beside=beside_image("fig10"),
    log:
        "logs/paper/fig10.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        source=SOURCE_OF_SEQUENCES,
        published=published_file_flag,
    message:
        FIGURES["fig10"].title
    shell:
        "python -m vigauge_paper.commands.figure_covariance --kind matrices --covariance {input.covariance:q}"
        " --source {params.source} {params.published} --output {output.png:q} --stamps {input.stamps:q} &> {log:q}"


rule figure_sequence_cost:
    input:
        expand("data/solutions/{name}/solutions.csv", name=PAPER_SEQUENCES),
        TIMINGS[MACHINE_HALL],
        published=published(FIGURES["fig11"].stem),
        stamps=[*expand("data/solutions/{name}/stamp.json", name=PAPER_SEQUENCES), TIMING_STAMPS[1]],
        code=code_of("figure_cost"),
    output:
        png=figure_image("fig11"),
        beside=beside_image("fig11"),
    log:
        "logs/paper/fig11.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        solutions=expand("{name}=data/solutions/{name}/solutions.csv", name=PAPER_SEQUENCES),
        timings=[f"{name}={TIMINGS[name]}" for name in PAPER_SEQUENCES],
        source=SOURCE_OF_SEQUENCES,
        published=FIGURE11_PUBLISHED,
    message:
        FIGURES["fig11"].title
    shell:
        "python -m vigauge_paper.commands.figure_cost --solutions {params.solutions:q} --timings {params.timings:q}"
        " --source {params.source} {params.published} --output {output.png:q} --stamps {input.stamps:q} &> {log:q}"


rule figure_nees:
    input:
        table=REASON_TABLES["nees"],
        stamps="data/reasons/stamp.json",
        code=code_of("figure_nees"),
    output:
        png=figure_image("nees"),
        beside=beside_image("nees"),
    log:
        "logs/paper/nees.log",
    conda:
        "../envs/vigauge.yaml"
    message:
        FIGURES["nees"].title
    shell:
        "python -m vigauge_paper.commands.figure_nees --table {input.table:q} --output {output.png:q}"
        " --stamps {input.stamps:q} &> {log:q}"


rule figure_reading:
    input:
        pulls="data/reasons/reading.csv",
        stamps="data/reasons/stamp.json",
        code=code_of("figure_reading"),
    output:
        png=figure_image("prior_reading"),
        beside=beside_image("prior_reading"),
    log:
        "logs/paper/prior_reading.log",
    conda:
        "../envs/vigauge.yaml"
    message:
        FIGURES["prior_reading"].title
    shell:
        "python -m vigauge_paper.commands.figure_reading --pulls {input.pulls:q} --output {output.png:q}"
        " --stamps {input.stamps:q} &> {log:q}"


rule figure_errors:
    input:
        expand("data/covariance/{name}.npz", name=PAPER_SEQUENCES),
        expand("data/sequences/{name}/truth.npz", name=PAPER_SEQUENCES),
        stamps=[
            *expand("data/covariance/{name}.stamp.json", name=PAPER_SEQUENCES),
            *expand("data/sequences/{name}/stamp.json", name=PAPER_SEQUENCES),
        ],
        code=code_of("figure_errors"),
    output:
        png=figure_image("fig_errors"),
        beside=beside_image("fig_errors"),
    log:
        "logs/paper/fig_errors.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        covariances=expand("{name}=data/covariance/{name}.npz", name=PAPER_SEQUENCES),
        truths=expand("{name}=data/sequences/{name}/truth.npz", name=PAPER_SEQUENCES),
        source=SOURCE_OF_SEQUENCES,
    message:
        FIGURES["fig_errors"].title
    shell:
        "python -m vigauge_paper.commands.figure_errors --covariances {params.covariances:q} --truths {params.truths:q}"
        " --source {params.source} --output {output.png:q} --stamps {input.stamps:q} &> {log:q}"


rule claims:
    input:
        expand("data/solutions/{name}/solutions.csv", name=EXPERIMENTS),
        sorted(set(TIMINGS.values())),
        expand("data/covariance/{name}.npz", name=EXPERIMENTS),
        list(REASON_TABLES.values()),
        sweep="data/prior_sweep/sweep.csv",
        sweep_trace="data/prior_sweep/trace.csv",
        machine="data/timing/simulation.json",
        stamps=[
            *expand("data/solutions/{name}/stamp.json", name=EXPERIMENTS),
            *expand("data/covariance/{name}.stamp.json", name=EXPERIMENTS),
            *TIMING_STAMPS,
            "data/prior_sweep/stamp.json",
            "data/reasons/stamp.json",
            *expand("data/timing_reasons/{name}.stamp.json", name=TIMED),
        ],
        code=code_of("claims"),
    output:
        csv=report(f"{OUT}/claims.csv", caption="../report/claims.rst", category="Claims"),
        md=f"{OUT}/claims.md",
        why=report(f"{OUT}/claims_why.csv", caption="../report/claims_why.rst", category="Claims"),
        statistics=report(
            f"{OUT}/claims_statistics.csv", caption="../report/claims_statistics.rst", category="Claims"
        ),
    log:
        "logs/paper/claims.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        solutions=expand("{name}=data/solutions/{name}/solutions.csv", name=EXPERIMENTS),
        timings=[f"{name}={file}" for name, file in TIMINGS.items()],
        covariances=expand("{name}=data/covariance/{name}.npz", name=EXPERIMENTS),
        reasons=[f"{name}={file}" for name, file in REASON_TABLES.items()],
        sweep_configuration=config["prior"]["sweep_configuration"],
        machine_hall=MACHINE_HALL,
        vicon_room=VICON_ROOM,
        source=SOURCE_OF_CLAIMS,
        criteria=section("claims"),
        reading=config["prior"]["reading"],
        evidence=[f"{name}={file}" for name, file in EVIDENCE.items()],
        sensitivity=where_made("--sensitivity", SENSITIVITY, SENSITIVITY_STAMP),
        sensitivity_digest=digest_where_made(SENSITIVITY),
    message:
        "Judging the paper's claims"
    shell:
        "python -m vigauge_paper.commands.claims --solutions {params.solutions:q} --timings {params.timings:q}"
        " --covariances {params.covariances:q} --reasons {params.reasons:q} --sweep {input.sweep:q}"
        " --sweep-trace {input.sweep_trace:q}"
        " --sweep-configuration {params.sweep_configuration} --machine-hall {params.machine_hall}"
        " --vicon-room {params.vicon_room} --source {params.source} --machine {input.machine:q} --criteria {params.criteria:q} --prior-reading {params.reading}"
        " --output {output.csv:q} --why {output.why:q} --statistics {output.statistics:q}"
        " --evidence {params.evidence:q} {params.sensitivity} --stamps {input.stamps:q} &> {log:q}"


rule index:
    input:
        [*IMAGES.values(), *EXPLAINING.values()],
        tables=[f"{OUT}/{table}.md" for table in TABLES],
        claims=f"{OUT}/claims.csv",
        why=f"{OUT}/claims_why.csv",
        environment=f"{OUT}/environment.json",
        explorers=expand("data/explorer/{estimate}.json", estimate=EXPLORED),
        stamps=expand("data/{kind}/{name}/stamp.json", kind=["sequences", "solutions"], name=SEQUENCES),
        captions=[os.path.relpath(ROOT / f"workflow/report/{key}.rst") for key in FIGURES],
        page=sorted(os.path.relpath(file) for file in SOURCE.glob("vigauge_paper/page/*.*")),
        code=code_of("index"),
    output:
        report(f"{OUT}/index.html", caption="../report/index.rst", category="Claims"),
    log:
        "logs/paper/index.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        captions=folder_of_captions,
        tables=[f"{table}={OUT}/{table}.md" for table in TABLES],
        figures=[f"{name}={file}" for name, file in IMAGES.items()],
        evidence=[f"{name}={file}" for name, file in EXPLAINING.items()],
        published=figures_beside_the_paper(),
        extensions=extensions,
        spread=where_made("--spread", SPREAD_TABLE, SPREAD_STAMP),
        extensions_digest=[digest_where_made(table) for table in (WINDOWS_TABLE, SPREAD_TABLE)],
        source=SOURCE_OF_CLAIMS,
    message:
        "The page that a reader opens first"
    shell:
        "python -m vigauge_paper.commands.index --claims {input.claims:q} --why {input.why:q}"
        " --environment {input.environment:q} --captions {params.captions:q} --tables {params.tables:q}"
        " --figures {params.figures:q} --evidence {params.evidence:q} --published {params.published:q} --extensions {params.extensions:q}"
        " {params.spread} --explorers {input.explorers:q} --source {params.source} --output {output:q}"
        " --stamps {input.stamps:q} &> {log:q}"


rule comparison:
    input:
        expand("data/solutions/{name}/solutions.csv", name=EXPERIMENTS),
        sorted(set(TIMINGS.values())),
        expand("data/covariance/{name}.npz", name=EXPERIMENTS),
        published=expand("{folder}/{file}", folder=PUBLISHED_FOLDER, file=COMPARED_FILES),
        sweep="data/prior_sweep/sweep.csv",
        sweep_timing="data/prior_sweep/timing.csv",
        sweep_trace="data/prior_sweep/trace.csv",
        problems=f"data/simulation/{config['prior']['sweep_configuration']}/problems.npz",
        hypothesis=REASON_TABLES["bias_hypothesis"],
        stamps=[
            *expand("data/solutions/{name}/stamp.json", name=EXPERIMENTS),
            *expand("data/covariance/{name}.stamp.json", name=EXPERIMENTS),
            "data/prior_sweep/stamp.json",
            "data/reasons/stamp.json",
        ],
        code=code_of("comparison"),
    output:
        csv=report(f"{OUT}/comparison.csv", caption="../report/comparison.rst", category="Claims"),
        md=f"{OUT}/comparison.md",
    log:
        "logs/paper/comparison.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        solutions=expand("{name}=data/solutions/{name}/solutions.csv", name=EXPERIMENTS),
        timings=[f"{name}={file}" for name, file in TIMINGS.items()],
        covariances=expand("{name}=data/covariance/{name}.npz", name=EXPERIMENTS),
        published=folder_of_published,
        reading=config["prior"]["reading"],
        solver=section("solver"),
        seed=config["claims"]["seed"],
        source=SOURCE_OF_CLAIMS,
        names=[
            f"{name}={PUBLISHED_NAMES[name]}"
            for name in (PAPER_SEQUENCES if SEQUENCES_ARE_PUBLISHED else [])
        ],
        sensitivity=where_made("--sensitivity", SENSITIVITY, SENSITIVITY_STAMP),
        sensitivity_digest=digest_where_made(SENSITIVITY),
    message:
        "Published numbers and ours, with ranges and ratios"
    shell:
        "python -m vigauge_paper.commands.comparison --solutions {params.solutions:q} --timings {params.timings:q}"
        " --covariances {params.covariances:q} --sweep {input.sweep:q} --sweep-timing {input.sweep_timing:q}"
        " --sweep-trace {input.sweep_trace:q} --problems {input.problems:q} --prior-reading {params.reading}"
        " --solver {params.solver:q} --hypothesis {input.hypothesis:q} --published {params.published:q} --seed {params.seed}"
        " --source {params.source} --published-names {params.names:q} {params.sensitivity} --output {output.csv:q}"
        " --stamps {input.stamps:q} &> {log:q}"


rule summary:
    input:
        f"{OUT}/table2.csv",
        f"{OUT}/table2.md",
        f"{OUT}/table3.csv",
        f"{OUT}/table3.md",
        f"{OUT}/{FIGURES['fig07'].stem}.csv",
        f"{OUT}/{FIGURES['fig11'].stem}.csv",
        f"{OUT}/claims.csv",
        published=expand("{folder}/{file}.csv", folder=PUBLISHED_FOLDER, file=SUMMARY_FILES),
        code=code_of("summary"),
    output:
        f"{OUT}/summary.md",
    log:
        "logs/paper/summary.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        artefacts=folder_of_output,
        published=folder_of_published,
        source=SOURCE_OF_SEQUENCES,
        names=[f"{name}={theirs}" for name, theirs in PUBLISHED_NAMES.items()],
    message:
        "Paper and reproduction side by side"
    shell:
        "python -m vigauge_paper.commands.summary --artefacts {params.artefacts:q} --published {params.published:q}"
        " --source {params.source} --published-names {params.names:q} --output {output:q} &> {log:q}"


rule readme:
    input:
        summary=f"{OUT}/summary.md",
        figure=f"{OUT}/{FIGURES['fig09'].stem}.png",
        code=code_of("readme"),
    output:
        touch("data/readme.done"),
    log:
        "logs/paper/readme.log",
    conda:
        "../envs/vigauge.yaml"
    params:
        readme=os.path.relpath(ROOT / "README.md"),
        shown=os.path.relpath(ROOT / "docs/covariance.png"),
    message:
        "Putting the summary into README.md"
    shell:
        "python -m vigauge_paper.commands.readme --summary {input.summary:q} --readme {params.readme:q}"
        " --figure {input.figure:q} --shown {params.shown:q} &> {log:q}"
