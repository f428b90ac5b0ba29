"""Solve an experiment in the three gauges, and with the prior as printed."""

import argparse
import math

from vigauge.cli.command import LOG
from vigauge.covariance.consistency import chi_square
from vigauge.files import write_rows
from vigauge.model.archive import load_problems, load_states, save_states
from vigauge.observability.diagnosis import diagnose
from vigauge.solver.levenberg_marquardt import Options
from vigauge_paper.experiments.interleaved import TimedSolve, Trial, solution_row, solve_once, trace_rows
from vigauge_paper.experiments.solves import bias_errors, under_noise
from vigauge_paper.ids import GAUGES
from vigauge_paper.prior import gauges as gauges_of
from vigauge_paper.run.artefacts import FILE, PRIOR_KEYS, add_prior, add_solver
from vigauge_paper.run.progress import progress
from vigauge_paper.run.stage import Stamped, json_argument, parser, run, settings_from


def _consistency(timed: TimedSolve) -> dict[str, object]:
    """Whether the problem is degenerate at the estimate, and the chi-square per redundancy of the two
    groups of measurements: near 1 if the noise is right.

    NaN where the run did not converge, as there is no minimum to speak of, and where more than
    the gauge is unobservable.
    """
    problem, state = timed.trial.problem, timed.solution.state
    # Where already the start has no finite cost there is nothing to linearise.
    degenerate = math.isfinite(timed.solution.cost) and diagnose(problem, state).degenerate
    visual = inertial = math.nan
    if timed.solution.converged and not degenerate:
        found = chi_square(problem, state)
        visual, inertial = found.visual, found.inertial
    return {
        "degenerate": degenerate,
        "visual_chi2_per_redundancy": visual,
        "inertial_chi2_per_redundancy": inertial,
    }


def work(options: argparse.Namespace) -> None:
    solver = settings_from(Options, options.solver, "solver")
    gauges = gauges_of(options.prior_weight, options.prior_reading)
    truth = load_states(options.truth)[0]
    models = under_noise(load_problems(options.problems), options.noise)

    trials = [
        Trial({"noise": name, "trial": index}, problem)
        for name, problems in models.items()
        for index, problem in enumerate(problems)
    ]
    bar = progress(trials, "solved", "trial", len(trials))
    solves = list(solve_once(bar, gauges, solver))
    rows = [solution_row(s, truth) | bias_errors(s.solution.state, truth) | _consistency(s) for s in solves]
    write_rows(options.solutions, rows)
    write_rows(options.trace, [row for s in solves for row in trace_rows(s)])
    shown = [s for s in solves if s.trial.labels["trial"] == 0 and s.gauge in GAUGES]
    save_states(options.states, [s.solution.state for s in shown], [s.solution.status for s in shown])
    failed = sum(not s.solution.converged for s in solves)
    degenerate = sum(bool(row["degenerate"]) for row in rows)
    LOG.info("%d solves, %d without convergence, %d degenerate", len(solves), failed, degenerate)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--problems", **FILE)
    arguments.add_argument("--truth", **FILE)
    add_prior(arguments)
    add_solver(arguments)
    arguments.add_argument(
        "--noise", type=json_argument, default={}, help="noise models: sigma_px and density_factor"
    )
    arguments.add_argument("--solutions", **FILE, help="output: a row a solve")
    arguments.add_argument("--trace", **FILE, help="output: a row an iteration")
    arguments.add_argument(
        "--states", **FILE, help="output: estimates of trial 0, a noise model and gauge each"
    )
    run(work, arguments, Stamped({"solver": "solver"} | PRIOR_KEYS, outputs=("solutions", "trace", "states")))


if __name__ == "__main__":
    main()
