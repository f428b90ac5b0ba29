"""The paper's experiment with biases in the state, which the paper leaves out: 15 parameters a keyframe.

Every trial is solved twice from the same start and images: with known biases, as in the paper, and with
biases that walk, estimated from a start at zero.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from vigauge.covariance.covariance import Covariance, motion_pseudo_inverse
from vigauge.covariance.transform import transform_covariance
from vigauge.errors import DegenerateError
from vigauge.gauge.gauges import FixedGauge, Gauge, three_gauges
from vigauge.geometry.so3 import Array
from vigauge.model.evaluation import relative_frobenius, trajectory_errors
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.levenberg_marquardt import Options, Solution
from vigauge.solver.reintegration import solve_with_samples
from vigauge.synthetic.biases import BiasedTrial, make_biased_trial
from vigauge.synthetic.scenario import make_scene, make_trial

from ..ids import BIAS_ERRORS, CONFIGURATIONS, ERRORS, ESTIMATED, FIX, KNOWN, Row
from .experiment import Experiment, Material
from .interleaved import TimedSolve, Trial, solve_interleaved
from .solves import bias_errors

SECONDS = "seconds_per_iteration"
ERRORS_IN_WORDS = {
    "p_rmse_m": "position",
    "phi_rmse_deg": "rotation",
    "v_rmse_mps": "velocity",
    "gyro_bias_rmse_radps": "gyroscope bias",
    "accel_bias_rmse_mps2": "accelerometer bias",
}


@dataclass(frozen=True)
class Settings:
    """``trials`` of every configuration, each solved ``repeats`` times for its time.

    ``gyro_walk`` (rad/s^2/sqrt(Hz)) and ``accel_walk`` (m/s^3/sqrt(Hz)) are random walks of the true biases,
    which begin at those of the simulation's settings.
    """

    trials: int
    repeats: int
    gyro_walk: float
    accel_walk: float


@dataclass(frozen=True)
class _Covariances:
    """At an estimate: the free covariance taken to the fixed gauge by (12), its distance to the fixed one at
    the same point, and the rank of H."""

    transformed: Array
    same_point: float
    rank: int

    @classmethod
    def of(cls, problem: Problem, state: State) -> _Covariances:
        at_state, gauge = Covariance.of(problem, state), FixedGauge()
        free = motion_pseudo_inverse(at_state)
        transformed, moved = transform_covariance(free, state, gauge, problem.initial)
        fixed = Covariance.of(problem, moved).motion(gauge)
        return cls(transformed, relative_frobenius(transformed, fixed), at_state.spectrum().rank)


def rows(material: Material, settings: Settings) -> list[Row]:
    """A row a configuration, trial, gauge, and whether biases are known or estimated.

    ``iterations`` and ``seconds`` are those of the solve from the start. Errors and covariances are those of
    the estimate; where biases are estimated, after inertial factors were integrated anew at the biases found.
    """
    gauges = three_gauges(material.prior_information)
    out: list[Row] = []
    for name, (trajectory, points) in CONFIGURATIONS.items():
        scene = make_scene(trajectory, points, material.simulation)
        walks = settings.gyro_walk, settings.accel_walk
        biased = [make_biased_trial(scene, trial, *walks) for trial in range(settings.trials)]
        starts = [
            Trial({"experiment": name, "trial": trial, "biases": biases}, problem)
            for trial, one in enumerate(biased)
            for biases, problem in ((KNOWN, make_trial(scene, trial)), (ESTIMATED, one.problem))
        ]
        solves = list(
            solve_interleaved(starts, gauges, material.solver, clock=material.clock, repeats=settings.repeats)
        )
        for start in starts:
            one = biased[int(str(start.labels["trial"]))]
            out += _trial_rows(start, [s for s in solves if s.trial is start], one, gauges, material.solver)
    return out


def _trial_rows(
    start: Trial,
    solves: Sequence[TimedSolve],
    biased: BiasedTrial,
    gauges: Mapping[str, Gauge],
    options: Options,
) -> list[Row]:
    """The rows of one problem, all gauges; fixation is the first of them."""
    out: list[Row] = []
    fixed: _Covariances | None = None
    for label, gauge in gauges.items():
        mine = [solve.solution for solve in solves if solve.gauge == label]
        problem, solution = start.problem, mine[0]
        if problem.estimates_biases:
            problem, solution = solve_with_samples(
                problem, gauge, biased.samples, biased.keyframe_ns, biased.noise, options
            )
        found = _covariances(problem, solution)
        fixed = found if label == FIX else fixed
        errors = trajectory_errors(solution.state, biased.truth)
        out.append(
            {
                **start.labels,
                "gauge": label,
                "status": str(solution.status),
                "converged": solution.converged,
                "iterations": mine[0].iterations,
                "seconds": min(one.seconds for one in mine),
                **{name: getattr(errors, name) for name in ERRORS},
                **bias_errors(solution.state, biased.truth),
                "parameters": problem.initial.n_parameters,
                "hessian_rank": found.rank if found else "",
                "relative_frobenius_same_point": found.same_point if found else "",
                "relative_frobenius_converged": relative_frobenius(found.transformed, fixed.transformed)
                if found and fixed
                else "",
            }
        )
    return out


def _covariances(problem: Problem, solution: Solution) -> _Covariances | None:
    """None where the run did not converge or the problem is degenerate: there is no covariance then."""
    try:
        return _Covariances.of(problem, solution.state) if solution.converged else None
    except DegenerateError:
        return None


def error_rows(runs: pd.DataFrame) -> list[Row]:
    """Means of the converged runs: a row a configuration, gauge, and known or estimated biases."""
    good = runs[runs["converged"]].groupby(["experiment", "biases", "gauge"], sort=False)
    means = good[[*ERRORS, *BIAS_ERRORS, "iterations"]].mean().assign(trials=good.size()).reset_index()
    rows: list[Row] = means.rename(columns={"experiment": "configuration"}).to_dict("records")
    # Known biases have no errors: the cell is empty.
    return [{key: "" if pd.isna(value) else value for key, value in row.items()} for row in rows]


def sentence(runs: pd.DataFrame) -> str:
    """What unknown biases cost under fixation: errors, iterations and time."""
    good = runs[runs["converged"] & (runs["gauge"] == FIX)]
    good = good.assign(**{SECONDS: good["seconds"] / good["iterations"]})
    middle = good.groupby(["biases", "experiment"])[[*ERRORS, "iterations", SECONDS]].median()
    if not {KNOWN, ESTIMATED} <= set(good["biases"]):
        return ""
    ratio = (middle.loc[ESTIMATED] / middle.loc[KNOWN]).median()
    more = float((middle.loc[ESTIMATED, "iterations"] - middle.loc[KNOWN, "iterations"]).median())
    errors = ", ".join(f"{ratio[name]:.1f} ({ERRORS_IN_WORDS[name]})" for name in ERRORS)
    return (
        f"Under fixation, errors with estimated biases are {errors} times those with known ones; the "
        f"optimisation takes {more:.1f} iterations more, each {ratio[SECONDS]:.1f} times as long (medians "
        "over the flights)."
    )


EXPERIMENT = Experiment("biases", rows, Settings, timed=True)
