"""Solve one configuration under a range of prior weights (Section V-A, Figs. 4-6).

Every weight is used as a factor of the residual and as information; the free gauge stands beside both.
"""

import argparse

from vigauge.cli.command import LOG
from vigauge.files import write_rows
from vigauge.gauge.gauges import Gauge
from vigauge.model.archive import load_problems, load_states
from vigauge.observability.spectrum import condition_number
from vigauge.solver.levenberg_marquardt import Options
from vigauge.solver.normal_equations import linearise
from vigauge_paper.experiments.interleaved import (
    TimedSolve,
    Trial,
    solution_row,
    solve_once,
    trace_rows,
)
from vigauge_paper.ids import Row
from vigauge_paper.prior import READINGS, swept
from vigauge_paper.run.artefacts import FILE, add_solver
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
    rows: dict[str, list[Row]] = {"sweep": [], "trace": []}
    for reading in READINGS:
        gauges, label = swept(options.weights, reading), {"reading": reading}
        for s in solve_once(trials, gauges, solver):
            end = solution_row(s, truth, "weight") | _conditioning(s, gauges[s.gauge])
            rows["sweep"].append(label | end)
            rows["trace"] += [label | row for row in trace_rows(s, "weight")]
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
    arguments.add_argument("--sweep", **FILE, help="output: a row a solve")
    arguments.add_argument("--trace", **FILE, help="output: a row an iteration")
    run(
        work,
        arguments,
        Stamped(
            {"solver": "solver", "weights": "prior.sweep_weights"},
            outputs=("sweep", "trace"),
        ),
    )


if __name__ == "__main__":
    main()
