"""Write the paper-versus-ours table of docs/paper.md from the finished artefacts."""

import argparse
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from vigauge.files import write_text
from vigauge_paper.claims import Verdict
from vigauge_paper.figures.registry import FIGURES
from vigauge_paper.ids import ERRORS, FIX, FREE, STAND_IN, Row
from vigauge_paper.run.artefacts import FILE, add_published_names
from vigauge_paper.run.stage import parser, run
from vigauge_paper.tables import markdown

FIG07, FIG11 = (FIGURES[key].stem for key in ("fig07", "fig11"))


def _pair(theirs: Any, case: str | None, gauge: str, ours: float) -> str:
    published = "-" if case is None else f"{float(theirs[(case, gauge)]):.4g}"
    return f"{published} / {ours:.4g}"


def _by_case(file: Path) -> Any:
    """A table by its first column, the case, and the gauge."""
    table = pd.read_csv(file)
    return table.set_index([table.columns[0], "gauge"])


def _rows(
    figures: Path, published: Path, table: str, cost: str, names: Mapping[str, str | None]
) -> list[Row]:
    """One row a case and gauge: paper / ours for errors and median iterations.

    ``table`` and ``cost`` name files of both folders. ``names`` maps a case to the paper's, or to None
    where the paper has no such case.
    """
    ours, theirs = (_by_case(folder / f"{table}.csv") for folder in (figures, published))
    counts, their_counts = (
        _by_case(folder / f"{cost}.csv").query("quantity == 'iterations'")["median"]
        for folder in (figures, published)
    )
    rows = []
    for case, their_case in names.items():
        for gauge in (FIX, FREE):
            row: Row = {"case": case.replace("_", " "), "gauge": gauge}
            for error, unit in zip(ERRORS, ("position, m", "rotation, deg", "velocity, m/s"), strict=True):
                value = float(ours.loc[(case, gauge), error])
                row[unit] = _pair(theirs[error], their_case, gauge, value)
            row["iterations"] = _pair(their_counts, their_case, gauge, float(counts[(case, gauge)]))
            rows.append(row)
    return rows


def _marked(table: str) -> str:
    """The sentences of a table's note on runs that were left out or are degenerate, where there are any."""
    found = re.search(r" (?:Left out|Degenerate): .*| Left out, .*", table)
    return found[0] if found else ""


def work(options: argparse.Namespace) -> None:
    figures, published = options.artefacts, options.published
    theirs = dict(options.published_names)
    table2, fig11 = (pd.read_csv(figures / f"{name}.csv") for name in ("table2", FIG11))
    simulation = {name: name for name in table2["configuration"]}
    sequences = {name: theirs.get(name) for name in fig11["experiment"]}
    rows = _rows(figures, published, "table2", FIG07, simulation)
    rows += _rows(figures, published, "table3", FIG11, sequences)
    claims = pd.read_csv(figures / "claims.csv")
    count = claims["verdict"].value_counts()
    verdicts = ", ".join(f"{count.get(name, 0)} {name}" for name in Verdict)
    note = (
        "Paper / ours. RMSE: mean over trials; iterations: median, as Ceres counts them. Problems are alike, "
        "not the same: the paper does not give landmarks, noise or windows (config/README.md has ours)."
    )
    if options.source == "rendered":
        note += f" The two sequences are a {STAND_IN}."
    note += _marked((figures / "table2.md").read_text(encoding="utf-8"))
    note += "\n\nSequences: " + (figures / "table3.md").read_text(encoding="utf-8").strip().splitlines()[-1]
    # What was measured is long for some; claims.md has it.
    short = claims[["claim", "section", "published", "verdict"]].to_dict("records")
    text = markdown(rows, note) + f"\nClaims: {verdicts}.\n\n" + markdown(short)
    write_text(options.output, text)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--artefacts", **FILE, help="folder of the finished tables and figures")
    arguments.add_argument("--published", **FILE, help="folder of the published numbers")
    arguments.add_argument("--source", choices=("euroc", "rendered"), required=True)
    add_published_names(arguments)
    arguments.add_argument("--output", **FILE)
    run(work, arguments)


if __name__ == "__main__":
    main()
