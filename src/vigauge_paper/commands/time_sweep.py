"""Time the solves of one configuration under a range of prior weights (Fig. 5), weights interleaved."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable

from vigauge.files import write_rows
from vigauge.model.archive import load_problems
from vigauge.solver.levenberg_marquardt import Options
from vigauge_paper.experiments.interleaved import Trial, solve_interleaved, timing_row
from vigauge_paper.ids import Row
from vigauge_paper.prior import READINGS, swept
from vigauge_paper.run.artefacts import FILE, add_solver
from vigauge_paper.run.progress import progress
from vigauge_paper.run.stage import Stamped, parser, run, settings_from


def work(options: argparse.Namespace) -> None:
    solver = settings_from(Options, options.solver, "solver")
    trials = [Trial({"trial": i}, p) for i, p in enumerate(load_problems(options.problems))]

    def bar(turn: Iterable[Trial]) -> Iterable[Trial]:
        return progress(turn, "prior weights", "trial", len(trials))

    rows: list[Row] = []
    for reading in READINGS:
        timed = solve_interleaved(
            trials,
            swept(options.weights, reading),
            solver,
            clock=time.perf_counter,
            repeats=options.repeats,
            progress=bar,
        )
        rows += [{"reading": reading} | timing_row(s, "weight") for s in timed]
    write_rows(options.timing, rows)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--problems", **FILE)
    arguments.add_argument("--weights", nargs="+", required=True, help="prior weights, as they are written")
    add_solver(arguments)
    arguments.add_argument("--repeats", type=int, required=True, help="timed repeats of every trial")
    arguments.add_argument("--timing", **FILE, help="output: seconds of each solve")
    run(
        work,
        arguments,
        Stamped({"solver": "solver", "weights": "prior.sweep_weights"}, timings=("timing",)),
    )


if __name__ == "__main__":
    main()
