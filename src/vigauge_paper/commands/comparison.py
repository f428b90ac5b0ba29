"""Set every published number beside ours, with the ratio."""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from vigauge.cli.command import LOG
from vigauge.files import write_rows, write_text
from vigauge_paper.comparison.numbers import FACTOR, comparison_rows, numbers, score
from vigauge_paper.ids import STAND_IN
from vigauge_paper.run.artefacts import add_published_names
from vigauge_paper.run.stage import parser, run
from vigauge_paper.tables import markdown

Row = dict[str, object]


def _page(rows: list[Row], scores: tuple[float, float], source: str) -> str:
    table = pd.DataFrame(rows)
    note = (
        f"Ours over the paper's. Table II under fixation: mean |log ratio| {scores[0]:.3f}, largest "
        f"{scores[1]:.3f}. All numbers: comparison.csv."
    )
    if source != "euroc":
        note += f" Table III and Figure 11 are left out: {STAND_IN}."
    marks = table.groupby("artefact", sort=False)["outside_factor_two"].agg(["size", "sum"])
    summary: list[Row] = [
        {"artefact": name, "numbers": int(size), f"outside a factor of {FACTOR:g}": int(outside)}
        for name, size, outside in marks.itertuples()
    ]
    outside = [
        {name: value for name, value in row.items() if name != "outside_factor_two"}
        for row in rows
        if row["outside_factor_two"]
    ]
    parts = ["# Published numbers and ours", markdown(summary, note)]
    if outside:
        parts += [f"## Outside a factor of {FACTOR:g}", markdown(outside)]
    return "\n".join(parts)


def work(options: argparse.Namespace) -> None:
    table = numbers(options.artefacts, options.published, dict(options.published_names))
    rows, scores = comparison_rows(table), score(table)
    write_rows(options.output, rows)
    write_text(options.output.with_suffix(".md"), _page(rows, scores, options.source))
    LOG.info(
        "%d numbers, %d outside a factor of two; Table II: mean |log ratio| %.3f, largest %.3f",
        len(rows),
        sum(number.outside for number in table),
        *scores,
    )


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--artefacts", type=Path, required=True, help="folder of tables and figures")
    arguments.add_argument("--published", type=Path, required=True, help="folder of the published numbers")
    arguments.add_argument("--source", choices=("euroc", "rendered", "other"), required=True)
    add_published_names(arguments)
    arguments.add_argument("--output", type=Path, required=True, help="CSV; the page goes beside it")
    run(work, arguments)


if __name__ == "__main__":
    main()
