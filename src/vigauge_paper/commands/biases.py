"""Which claims hold with biases in the state: a sentence each, the errors behind them, and a figure."""

import argparse
from pathlib import Path

import pandas as pd

from vigauge.files import write_rows, write_text
from vigauge_paper.claims import Criteria
from vigauge_paper.claims.biases import judge_biases
from vigauge_paper.experiments.biases import error_rows, sentence
from vigauge_paper.figures.biases import draw_biases
from vigauge_paper.run.artefacts import FILE, STEM, add_section
from vigauge_paper.run.stage import parser, run, settings_from
from vigauge_paper.tables import markdown

_ABOUT = """# Biases in the state: an extension

The paper takes biases as known. Here they are 6 of 15 parameters of every keyframe; the true ones walk, and
the estimate starts at zero. The claims are those of the ledger, by their id, judged on the simulated flights
with known and with estimated biases. Errors and iterations are judged on all flights together,
with {trials} trials a flight, and not flight by flight as in the ledger: verdicts need not be the same.
"""
_NOTE = "Mean RMSE and iterations of the runs that converged, by flight; trials: how many."


def work(options: argparse.Namespace) -> None:
    runs = pd.read_csv(options.runs)
    judged = judge_biases(runs, settings_from(Criteria, options.criteria, "claims"))
    errors = error_rows(runs)
    write_rows(f"{options.output}.csv", judged)
    write_rows(f"{options.output}_errors.csv", errors)
    draw_biases(Path(f"{options.output}.csv"), options.output)
    shown = pd.DataFrame(judged)[["id", "claim", "biases", "verdict", "sentence"]].drop_duplicates()
    claims = markdown(shown.to_dict("records"), sentence(runs))
    write_text(
        f"{options.output}.md",
        "\n".join(
            [_ABOUT.format(trials=runs["trial"].nunique()), claims, "## Errors", "", markdown(errors, _NOTE)]
        ),
    )


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--runs", **FILE, help="table of experiment 'biases'")
    add_section(arguments, "--criteria", "claims")
    about = "PNG; PDF, CSV and Markdown go beside it, the errors as NAME_errors.csv"
    arguments.add_argument("--output", **STEM, help=about)
    run(work, arguments)


if __name__ == "__main__":
    main()
