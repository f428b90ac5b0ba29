"""Put the paper-versus-ours table that the pipeline made into a page of the docs."""

import argparse

from vigauge.errors import DataError
from vigauge.files import write_text
from vigauge_paper.run.artefacts import FILE
from vigauge_paper.run.stage import parser, run

BEGIN = "<!-- results: made by `snakemake --cores 2 paper_page` -->"
END = "<!-- end of results -->"


def insert(page: str, summary: str, file: str) -> str:
    """The page with what stands between the marks replaced; DataError where a mark is missing."""
    for mark in (BEGIN, END):
        if page.count(mark) != 1:
            raise DataError(file, f"must hold the mark {mark!r} once", value=page.count(mark))
    before, rest = page.split(BEGIN)
    _, after = rest.split(END)
    return f"{before}{BEGIN}\n\n{summary.strip()}\n\n{END}{after}"


def work(options: argparse.Namespace) -> None:
    summary = options.summary.read_text(encoding="utf-8")
    page = options.page.read_text(encoding="utf-8")
    write_text(options.page, insert(page, summary, str(options.page)))


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--summary", **FILE, help="table made from the result files")
    arguments.add_argument("--page", **FILE, help="page to update")
    run(work, arguments)


if __name__ == "__main__":
    main()
