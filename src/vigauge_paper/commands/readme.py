"""Put the paper-versus-ours table that the pipeline made into the README, and the figure it shows."""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

from vigauge.errors import DataError
from vigauge.files import atomic_path, write_text
from vigauge_paper.run.stage import parser, run

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
    with atomic_path(options.shown) as temporary:
        shutil.copyfile(options.figure, temporary)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--summary", type=Path, required=True, help="table made from the result files")
    arguments.add_argument("--readme", type=Path, required=True, help="file to update")
    arguments.add_argument("--figure", type=Path, required=True, help="figure that the README shows")
    arguments.add_argument("--shown", type=Path, required=True, help="where the README has it")
    run(work, arguments)


if __name__ == "__main__":
    main()
