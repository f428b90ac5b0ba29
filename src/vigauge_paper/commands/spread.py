"""Median and range of the results over harmless changes of the front-end."""

import argparse

import pandas as pd

from vigauge.files import write_rows, write_text
from vigauge_paper.run.artefacts import FILE
from vigauge_paper.run.stage import Stamped, json_argument, parser, run
from vigauge_paper.spread import spread_rows, spread_sentence, spread_table
from vigauge_paper.tables import markdown


def work(options: argparse.Namespace) -> None:
    rows = []
    for sequence, names in options.changes.items():
        tables = [pd.read_csv(options.solutions / name / "solutions.csv") for name in names]
        rows += spread_rows(sequence, tables)
    write_rows(options.output, rows)
    table = pd.DataFrame(rows)
    text = markdown(spread_table(table), spread_sentence(table))
    write_text(options.output.with_suffix(".md"), text)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument(
        "--changes", type=json_argument, required=True, help="names of each sequence's changed forms"
    )
    arguments.add_argument("--solutions", **FILE, help="folder with a folder each")
    arguments.add_argument("--output", **FILE, help="output: CSV; Markdown goes beside it")
    run(
        work,
        arguments,
        Stamped({}, outputs=("output",), files=lambda options: [options.output.with_suffix(".md")]),
    )


if __name__ == "__main__":
    main()
