"""Solves of experiments, trial by trial in every gauge: once for their outcome, or repeated for their time.

Where times are taken, gauges are interleaved and their order turns from trial to trial, so that a slow
moment of the machine falls on all of them alike and times can be compared in pairs.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from vigauge.gauge.gauges import Gauge
from vigauge.model.evaluation import align_all_poses, trajectory_errors
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.levenberg_marquardt import Options, Solution, solve

from ..ids import ERRORS, Row


@dataclass(frozen=True)
class Trial:
    """A problem with the labels that its rows carry, e.g. {"trial": 3}."""

    labels: Row
    problem: Problem


@dataclass(frozen=True)
class TimedSolve:
    """One solve: which trial, which gauge, which repeat, and its outcome."""

    trial: Trial
    gauge: str
    repeat: int
    solution: Solution


def solve_once(
    trials: Iterable[Trial], gauges: Mapping[str, Gauge], options: Options
) -> Iterator[TimedSolve]:
    """Solve every trial in every gauge, in the order given, without taking times.

    ``gauges`` maps the label that rows carry to the gauge.
    """
    for trial in trials:
        for name, gauge in gauges.items():
            yield TimedSolve(trial, name, 0, solve(trial.problem, gauge, options))


def solve_interleaved(
    trials: Sequence[Trial],
    gauges: Mapping[str, Gauge],
    options: Options,
    *,
    clock: Callable[[], float],
    repeats: int = 1,
    progress: Callable[[Iterable[Trial]], Iterable[Trial]] = lambda trials: trials,
) -> Iterator[TimedSolve]:
    """Solve every trial in every gauge ``repeats`` times, gauges taking turns; each solve as it is done.

    A warm-up solve in each gauge goes unrecorded. ``progress`` may wrap the trials of a repeat,
    e.g. in a bar.
    """
    names = list(gauges)
    for name in names if trials else ():
        solve(trials[0].problem, gauges[name], options)
    for repeat in range(repeats):
        for index, trial in enumerate(progress(trials)):
            turn = (index + repeat) % len(names)
            for name in names[turn:] + names[:turn]:
                solution = solve(trial.problem, gauges[name], options, clock=clock)
                yield TimedSolve(trial, name, repeat, solution)


def solution_row(timed: TimedSolve, truth: State, label: str = "gauge") -> Row:
    """Outcome of one solve: status, counts, RMSE against the truth; no times."""
    problem, solution = timed.trial.problem, timed.solution
    end = trajectory_errors(solution.state, truth)
    start = trajectory_errors(problem.initial, truth)
    return {
        **timed.trial.labels,
        label: timed.gauge,
        "status": str(solution.status),
        "converged": solution.converged,
        "iterations": solution.iterations,
        "cost": solution.cost,
        **{name: getattr(end, name) for name in ERRORS},
        "p_rmse_all_poses_m": trajectory_errors(solution.state, truth, align_all_poses).p_rmse_m,
        "start_p_rmse_all_poses_m": trajectory_errors(problem.initial, truth, align_all_poses).p_rmse_m,
        **{f"start_{name}": getattr(start, name) for name in ERRORS},
        "mean_reprojection_px": solution.trace[-1].mean_reprojection_px,
    }


def trace_rows(timed: TimedSolve, label: str = "gauge") -> list[Row]:
    """The trace of one solve, a row an iteration, without times."""
    rows = []
    for number, iteration in enumerate(timed.solution.trace):
        values = iteration._asdict()
        del values["seconds"]
        rows.append({**timed.trial.labels, label: timed.gauge, "iteration": number, **values})
    return rows


def timing_row(timed: TimedSolve, label: str = "gauge") -> Row:
    """Seconds of one solve by the clock it was given."""
    return {
        **timed.trial.labels,
        label: timed.gauge,
        "repeat": timed.repeat,
        "iterations": timed.solution.iterations,
        "seconds": timed.solution.seconds,
    }
