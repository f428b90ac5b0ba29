"""What holding the yaw takes (Section III-A): iterated updates (8) against the total increment of (9)."""

from dataclasses import replace

import numpy as np

from vigauge.gauge.gauges import FixedGauge
from vigauge.geometry import so3
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.levenberg_marquardt import Options, solve

from ..ids import Row
from .experiment import Experiment, Material, Trials


def _yaw(state: State, start: State) -> float:
    """e_z^T Log(R_0 R_0^0^T), rad: what Eq. (10) sets to zero."""
    return float(so3.log(state.R_WB[0] @ start.R_WB[0].T)[2])


def yaw_drift(name: str, trial: int, problem: Problem, options: Options) -> list[Row]:
    """Yaw of the first keyframe, iteration by iteration, under both updates with a zero z part.

    Eq. (8) is run by starting anew from every iterate, so that each step is an increment of
    the rotation it finds; position held, trust region carried on.
    """
    start = problem.initial
    total = solve(problem, FixedGauge(), options, keep_states=True)
    rows: list[Row] = [
        _row(name, trial, "(9)", number, _yaw(state, start)) for number, state in enumerate(total.states)
    ]
    state, radius = start, options.initial_radius
    rows.append(_row(name, trial, "(8)", 0, 0.0))
    for number in range(1, len(total.states)):
        here = State.start(state.p_W, state.R_WB, state.v_W, state.X_W)
        one = replace(options, maximum_iterations=1, initial_radius=radius)
        step = solve(replace(problem, initial=here), FixedGauge(), one)
        state, radius = step.state, step.trace[-1].radius
        rows.append(_row(name, trial, "(8)", number, _yaw(state, start)))
    return rows


def _row(name: str, trial: int, update: str, iteration: int, yaw: float) -> Row:
    return {
        "experiment": name,
        "trial": trial,
        "update": update,
        "iteration": iteration,
        "yaw_deg": float(np.degrees(yaw)),
    }


def rows(material: Material, settings: Trials) -> list[Row]:
    """Every trial of every simulated configuration."""
    return [
        row
        for name in material.problems
        for trial, problem in enumerate(material.trials(name, settings.trials))
        for row in yaw_drift(name, trial, problem, material.solver)
    ]


EXPERIMENT = Experiment("yaw", rows, Trials, reads=("problems",))
