"""Write the paper-versus-ours table of the README from the finished artefacts."""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from vigauge.cli.stage import parser, run
from vigauge.files import write_text
from vigauge.tables import STAND_IN, markdown

Row = dict[str, object]
_ERRORS = ("p_rmse_m", "phi_rmse_deg", "v_rmse_mps")


def _pair(theirs: float, ours: float) -> str:
    return f"{theirs:.4g} / {ours:.4g}"


def _rows(
    table: Path, cost: Path, published_table: Path, published_cost: Path, names: dict[str, str], compare: bool
) -> list[Row]:
    """One row a case and gauge: paper / ours for errors and median iterations."""
    ours = pd.read_csv(table)
    ours = ours.set_index([ours.columns[0], "gauge"])
    counts = pd.read_csv(cost).query("quantity == 'iterations'").set_index(["experiment", "gauge"])["median"]
    theirs = pd.read_csv(published_table)
    theirs = theirs.set_index([theirs.columns[0], "gauge"])
    their_counts = pd.read_csv(published_cost).query("quantity == 'iterations'")
    their_counts = their_counts.set_index([their_counts.columns[0], "gauge"])["median"]
    rows = []
    for case, their_case in names.items():
        for gauge in ("fix", "free"):
            row: Row = {"case": case.replace("_", " "), "gauge": gauge}
            for error, unit in zip(_ERRORS, ("position, m", "rotation, deg", "velocity, m/s"), strict=True):
                value = float(ours.loc[(case, gauge), error])
                row[unit] = (
                    _pair(float(theirs.loc[(their_case, gauge), error]), value)
                    if compare
                    else f"- / {value:.4g}"
                )
            count = float(counts[(case, gauge)])
            row["iterations"] = (
                _pair(float(their_counts[(their_case, gauge)]), count) if compare else f"- / {count:g}"
            )
            rows.append(row)
    return rows


def work(options: argparse.Namespace) -> None:
    figures, published = options.artefacts, options.published
    simulation = list(dict.fromkeys(pd.read_csv(figures / "table2.csv")["configuration"]))
    sequences = list(dict.fromkeys(pd.read_csv(figures / "table3.csv")["sequence"]))
    euroc = options.source == "euroc"
    parts = [
        _rows(
            figures / "table2.csv",
            figures / "fig07_simulation_cost.csv",
            published / "table2.csv",
            published / "fig07_simulation_cost.csv",
            {name: name for name in simulation},
            True,
        ),
        _rows(
            figures / "table3.csv",
            figures / "fig11_euroc_cost.csv",
            published / "table3.csv",
            published / "fig11_euroc_cost.csv",
            dict(zip(sequences, ("MH", "VI"), strict=True)),
            euroc,
        ),
    ]
    claims = pd.read_csv(figures / "claims.csv")
    count = claims["verdict"].value_counts()
    verdicts = ", ".join(f"{count.get(name, 0)} {name}" for name in ("holds", "differs", "not tested"))
    note = (
        "Paper / ours. RMSE: mean over trials; iterations: median, as Ceres counts them. Problems are alike, "
        "not the same: the paper does not give landmarks, noise or windows (see Assumptions)."
    )
    if not euroc:
        note += f" The two sequences are a {STAND_IN}."
    short = claims[["claim", "published", "measured", "verdict"]].to_dict("records")
    text = markdown(parts[0] + parts[1], note) + f"\nClaims: {verdicts}.\n\n" + markdown(short)
    write_text(options.output, text)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument(
        "--artefacts", type=Path, required=True, help="folder of the finished tables and figures"
    )
    arguments.add_argument("--published", type=Path, required=True, help="folder of the published numbers")
    arguments.add_argument("--source", choices=("euroc", "rendered"), required=True)
    arguments.add_argument("--output", type=Path, required=True)
    run(work, arguments)


if __name__ == "__main__":
    main()
