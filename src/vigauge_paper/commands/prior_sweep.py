"""Solve one configuration under a range of prior weights (Section V-A, Figs. 4-6).

Every weight is used as a factor of the residual and as information; the free gauge stands beside both.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable

from vigauge.cli.command import LOG
from vigauge.files import write_rows
from vigauge.gauge.gauges import FreeGauge, Gauge, PriorGauge
from vigauge.model.archive import load_problems, load_states
from vigauge.observability.spectrum import condition_number
from vigauge.solver.levenberg_marquardt import Options
from vigauge.solver.normal_equations import linearise
from vigauge_paper.experiments.interleaved import (
    TimedSolve,
    Trial,
    solution_row,
    solve_interleaved,
    solve_once,
    timing_row,
    trace_rows,
)
from vigauge_paper.ids import FREE, Row
from vigauge_paper.prior import READINGS, information
from vigauge_paper.run.artefacts import FILE, add_solver
from vigauge_paper.run.progress import progress
from vigauge_paper.run.stage import Stamped, parser, run, settings_from


def _conditioning(timed: TimedSolve, gauge: Gauge) -> dict[str, object]:
    """Condition number of the scaled reduced system at the end of a run, its prior included."""
    problem, state = timed.trial.problem, timed.solution.state
    equations = linearise(problem, state)
    prior = gauge.prior(state, problem.initial)
    if prior is not None:
        equations = equations.with_factor(prior)
    return {"condition": condition_number(equations)}


def work(options: argparse.Namespace) -> None:
    solver = settings_from(Options, options.solver, "solver")
    truth = load_states(options.truth)[0]
    trials = [Trial({"trial": i}, p) for i, p in enumerate(load_problems(options.problems))]

    def bar(turn: Iterable[Trial]) -> Iterable[Trial]:
        return progress(turn, "prior weights", "trial", len(trials))

    rows: dict[str, list[Row]] = {"sweep": [], "trace": [], "timing": []}
    for reading in READINGS:
        gauges: dict[str, Gauge] = {w: PriorGauge(information(w, reading)) for w in options.weights}
        gauges[FREE] = FreeGauge()
        first = list(solve_once(trials, gauges, solver))
        label = {"reading": reading}
        rows["sweep"] += [
            label | solution_row(s, truth, "weight") | _conditioning(s, gauges[s.gauge]) for s in first
        ]
        rows["trace"] += [label | row for s in first for row in trace_rows(s, "weight")]
        timed = solve_interleaved(
            trials, gauges, solver, clock=time.perf_counter, repeats=options.repeats, progress=bar
        )
        rows["timing"] += [label | timing_row(s, "weight") for s in timed]
    for name, table in rows.items():
        write_rows(getattr(options, name), table)
    LOG.info("%d weights, %d trials", len(options.weights), len(trials))


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--problems", **FILE)
    arguments.add_argument("--truth", **FILE)
    arguments.add_argument(
        "--weights", nargs="+", required=True, help="prior weights, as they are to be written"
    )
    add_solver(arguments)
    arguments.add_argument("--repeats", type=int, default=1, help="timed repeats of every trial")
    arguments.add_argument("--sweep", **FILE, help="output: a row a solve")
    arguments.add_argument("--trace", **FILE, help="output: a row an iteration")
    arguments.add_argument("--timing", **FILE, help="output: seconds of each solve")
    run(
        work,
        arguments,
        Stamped(
            {"solver": "solver", "weights": "prior.sweep_weights"},
            outputs=("sweep", "trace"),
            timings=("timing",),
        ),
    )


if __name__ == "__main__":
    main()
