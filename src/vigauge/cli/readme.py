"""Put the paper-versus-ours table that the pipeline made into the README, between its two marks."""

from __future__ import annotations

import argparse
from pathlib import Path

from vigauge.cli.stage import parser, run
from vigauge.errors import DataError
from vigauge.files import write_text

BEGIN = "<!-- results: made by `snakemake --cores 2 readme` -->"
END = "<!-- end of results -->"


def insert(readme: str, summary: str, file: str) -> str:
    """The README with what stands between the marks replaced; DataError where a mark is missing."""
    for mark in (BEGIN, END):
        if readme.count(mark) != 1:
            raise DataError(file, f"must hold the mark {mark!r} once", value=readme.count(mark))
    before, rest = readme.split(BEGIN)
    _, after = rest.split(END)
    return f"{before}{BEGIN}\n\n{summary.strip()}\n\n{END}{after}"


def work(options: argparse.Namespace) -> None:
    summary = options.summary.read_text(encoding="utf-8")
    readme = options.readme.read_text(encoding="utf-8")
    write_text(options.readme, insert(readme, summary, str(options.readme)))


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--summary", type=Path, required=True, help="table made from the result files")
    arguments.add_argument("--readme", type=Path, required=True, help="file to update")
    run(work, arguments)


if __name__ == "__main__":
    main()
