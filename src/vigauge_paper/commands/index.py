"""Write the page that a reader opens first."""

import argparse
import json
from pathlib import Path

from vigauge.files import read_rows, write_text
from vigauge_paper.page.index import Material, index_page
from vigauge_paper.run.artefacts import FILE, named_file
from vigauge_paper.run.provenance import made_with
from vigauge_paper.run.stage import parser, run


def work(options: argparse.Namespace) -> None:
    extensions = dict(options.extensions)
    if options.spread and made_with(options.stamps, options.spread_stamp, "spread"):
        extensions["Harmless changes of the front-end"] = options.spread.with_suffix(".md")
    material = Material(
        rows=read_rows(options.claims),
        why={row["id"]: row["why"] for row in read_rows(options.why)},
        claims=options.claims.with_suffix(".md").read_text(encoding="utf-8"),
        figures=dict(options.figures),
        evidence=dict(options.evidence),
        tables=dict(options.tables),
        captions=options.captions,
        source=options.source,
        published=options.published,
        environment=json.loads(options.environment.read_text(encoding="utf-8")),
        extensions=extensions,
        explorers=[json.loads(file.read_text(encoding="utf-8")) for file in options.explorers],
    )
    write_text(options.output, index_page(material))


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--claims", **FILE, help="claims.csv, with claims.md beside it")
    arguments.add_argument("--why", **FILE, help="reason of each claim")
    arguments.add_argument("--environment", **FILE, help="environment.json")
    arguments.add_argument("--captions", **FILE, help="folder of the figures' captions")
    arguments.add_argument("--source", choices=("euroc", "rendered", "other"), required=True)
    arguments.add_argument(
        "--published", nargs="*", default=[], help="figures that show the paper's numbers beside ours"
    )
    for name, about, least in (
        ("figures", "NAME=FILE of figures (PNG)", "+"),
        ("evidence", "NAME=FILE of tables that explain (CSV)", "+"),
        ("tables", "NAME=FILE of Tables I to III (Markdown)", "+"),
        ("extensions", "TITLE=FILE of further results (Markdown or CSV)", "*"),
    ):
        arguments.add_argument(f"--{name}", type=named_file, nargs=least, default=[], help=about)
    arguments.add_argument("--spread", type=Path, help="spread over harmless changes, if there is one")
    arguments.add_argument("--spread-stamp", type=Path, help="stamp of that spread")
    arguments.add_argument("--explorers", type=Path, nargs="*", default=[], help="data of the gauge explorer")
    arguments.add_argument("--output", **FILE, help="the page")
    run(work, arguments)


if __name__ == "__main__":
    main()
