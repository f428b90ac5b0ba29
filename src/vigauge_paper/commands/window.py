"""Take one window of a recording through check, front-end, three gauges and covariance."""

from __future__ import annotations

import argparse
from pathlib import Path

from vigauge.cli.command import LOG
from vigauge.files import write_rows
from vigauge.recordings.frontend.settings import FrontEndSettings
from vigauge.solver.levenberg_marquardt import Options
from vigauge_paper.experiments.windows import WindowTask, run_window
from vigauge_paper.run.artefacts import add_prior_information, add_solver
from vigauge_paper.run.stage import json_argument, parser, run, settings_from


def work(options: argparse.Namespace) -> None:
    task = WindowTask(
        options.name,
        options.sequence,
        options.truth,
        options.biases,
        FrontEndSettings.from_mapping(options.settings),
        options.noise,
    )
    solver = settings_from(Options, options.solver, "solver")
    rows = run_window(task, solver, options.prior_information)
    write_rows(options.output, rows)
    stopped = rows[0]["stopped_at"]
    LOG.info("%s: %s", options.name, f"stopped at {stopped}: {rows[0]['why']}" if stopped else "whole")


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--name", required=True, help="name of the window in the results")
    arguments.add_argument("--sequence", type=Path, required=True, help="folder with mav0/ in it")
    arguments.add_argument("--truth", required=True, help="ground-truth folder below mav0, for evaluation")
    arguments.add_argument("--biases", required=True, help="the same, for the known biases")
    arguments.add_argument("--settings", type=json_argument, required=True, help="front-end settings")
    arguments.add_argument("--noise", type=json_argument, required=True, help="noise models by name")
    add_prior_information(arguments)
    add_solver(arguments)
    arguments.add_argument("--output", type=Path, required=True, help="output: a row a noise model and gauge")
    run(work, arguments)


if __name__ == "__main__":
    main()
