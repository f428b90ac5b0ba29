"""Set every published number beside ours, and say what explains each that is off by a factor of two."""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from vigauge.cli.command import LOG
from vigauge.files import write_rows, write_text
from vigauge_paper.comparison.numbers import FACTOR, numbers, score
from vigauge_paper.comparison.ratios import NOT_EXPLAINED, Experiments, comparison_rows, reasons
from vigauge_paper.ids import STAND_IN
from vigauge_paper.run.artefacts import add_published_names
from vigauge_paper.run.stage import parser, run
from vigauge_paper.tables import markdown

Row = dict[str, object]


def _summary(table: pd.DataFrame) -> list[Row]:
    """A row an artefact: how many numbers, how many outside the factor, and of those explained."""
    rows: list[Row] = []
    for artefact, part in table.groupby("artefact", sort=False):
        outside = part[part["outside_factor_two"]]
        missing = int(outside["explained_by"].str.startswith(NOT_EXPLAINED).sum())
        rows.append(
            {
                "artefact": artefact,
                "numbers": len(part),
                "outside a factor of two": len(outside),
                "explained": len(outside) - missing,
                NOT_EXPLAINED: missing,
            }
        )
    return rows


def _page(rows: list[Row], why: list[Row], scores: tuple[float, float], source: str) -> str:
    table = pd.DataFrame(rows)
    note = (
        f"Ours over the paper's. Table II under fixation: mean |log ratio| {scores[0]:.3f}, largest "
        f"{scores[1]:.3f}. An explanation is an experiment that brings the number inside a factor of "
        f"{FACTOR:g} without putting more numbers outside than before. All numbers: comparison.csv."
    )
    if source != "euroc":
        note += f" Table III and Figure 11 are left out: {STAND_IN}."
    outside = table[table["outside_factor_two"]].drop(columns="outside_factor_two").to_dict("records")
    parts = ["# Published numbers and ours", markdown(_summary(table), note), "## Experiments", markdown(why)]
    if outside:
        shown: list[Row] = [{str(k): v for k, v in row.items()} for row in outside]
        parts += ["## Outside a factor of two", markdown(shown)]
    return "\n".join(parts)


def work(options: argparse.Namespace) -> None:
    sequences = dict(options.published_names)
    table = numbers(options.artefacts, options.published, sequences)
    experiments = Experiments(
        options.reasons, options.landmark_times, options.published, sequences, options.drawn
    )
    rows, why = comparison_rows(table, experiments), reasons(table, experiments)
    scores = score(table)
    write_rows(options.output, rows)
    write_rows(options.why, why)
    write_text(options.output.with_suffix(".md"), _page(rows, why, scores, options.source))
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
    arguments.add_argument("--reasons", type=Path, required=True, help="folder of explaining experiments")
    arguments.add_argument(
        "--landmark-times", type=Path, required=True, help="times of iterations by number of landmarks"
    )
    arguments.add_argument("--source", choices=("euroc", "rendered", "other"), required=True)
    add_published_names(arguments)
    arguments.add_argument("--drawn", required=True, help="sequence that stands for that of Fig. 1")
    arguments.add_argument("--output", type=Path, required=True, help="CSV; the page goes beside it")
    arguments.add_argument("--why", type=Path, required=True, help="output: what the experiments found")
    run(work, arguments)


if __name__ == "__main__":
    main()
