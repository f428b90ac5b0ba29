"""Write the ledger as a page of HTML that holds its evidence."""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

from vigauge.files import write_text
from vigauge_paper.claims.page import claims_page
from vigauge_paper.run.artefacts import named_file
from vigauge_paper.run.stage import parser, run


def _rows(file: Path) -> list[dict[str, str]]:
    with file.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def work(options: argparse.Namespace) -> None:
    why = {row["id"]: row["why"] for row in _rows(options.why)}
    write_text(options.output, claims_page(_rows(options.claims), why, dict(options.evidence)))


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--claims", type=Path, required=True, help="claims.csv")
    arguments.add_argument("--why", type=Path, required=True, help="reason of each claim")
    arguments.add_argument(
        "--evidence",
        type=named_file,
        nargs="+",
        required=True,
        help="NAME=FILE, images (PNG) and tables (CSV)",
    )
    arguments.add_argument("--output", type=Path, required=True, help="the page")
    run(work, arguments)


if __name__ == "__main__":
    main()
