"""Outliers out before the gauges are compared: solve, drop what does not fit, solve again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverError
from ...gauge.gauges import FreeGauge
from ...geometry.so3 import Array
from ...model.problem import Problem
from ...model.state import State
from ...solver.levenberg_marquardt import solve
from ...solver.residuals import visual_residual
from .settings import OutlierSettings


@dataclass(frozen=True)
class Inliers:
    """What stays, and the errors that said so."""

    observation: NDArray[np.bool_]  # (M,) which observations of the problem stay
    # (M',) lengths of the reprojection errors of those that stay, at the start and at the solution.
    error_before_px: Array
    error_after_px: Array
    state: State  # the solution of the last round, all landmarks of the problem in it
    rounds: int  # rounds of solving


def reprojection_px(problem: Problem, state: State) -> Array:
    """(M,) lengths of the reprojection errors, measured px: ``problem.obs_noise`` is divided out."""
    return np.linalg.norm(visual_residual(problem, state), axis=1) * problem.sigma_px


def find_inliers(problem: Problem, settings: OutlierSettings, keyframes_per_landmark: int) -> Inliers:
    """Alternate solving in the free gauge and dropping observations with large errors.

    A round takes from each landmark its worst observation only: a wrong one bends its
    landmark, and good ones beside it may look wrong until it is gone.
    A landmark that is left with fewer than ``keyframes_per_landmark`` keyframes loses all its observations.

    Raises SolverError where a round does not converge.
    """
    start = problem.initial
    problem = problem.with_noise(settings.sigma_px, settings.density_factor)
    keep = np.ones(len(problem.obs_uv), dtype=bool)
    state = start
    rounds = 0
    while rounds < settings.rounds:
        reduced, landmarks = without(problem, keep, state)
        solution = solve(reduced, FreeGauge())
        rounds += 1
        if not solution.converged:
            raise SolverError(f"outlier round {rounds} ended with: {solution.status}")
        X_W = state.X_W.copy()
        X_W[landmarks] = solution.state.X_W
        state = _with_landmarks(solution.state, X_W)
        good = keep & ~_worst_of_landmark(problem, state, keep, settings.reprojection_px)
        good &= _enough_keyframes(problem, good, keyframes_per_landmark)[problem.obs_landmark]
        if np.array_equal(good, keep):
            break
        keep = good
    return Inliers(
        observation=keep,
        error_before_px=reprojection_px(problem, start)[keep],
        error_after_px=reprojection_px(problem, state)[keep],
        state=state,
        rounds=rounds,
    )


def _worst_of_landmark(
    problem: Problem, state: State, keep: NDArray[np.bool_], largest_px: float
) -> NDArray[np.bool_]:
    """(M,) observations among ``keep`` with the largest error of their landmark, above ``largest_px``."""
    error = np.where(keep, reprojection_px(problem, state), -1.0)
    of_landmark = np.zeros(problem.initial.n_landmarks)
    np.maximum.at(of_landmark, problem.obs_landmark, error)
    return (error > largest_px) & (error >= of_landmark[problem.obs_landmark])


def _enough_keyframes(problem: Problem, keep: NDArray[np.bool_], least: int) -> NDArray[np.bool_]:
    """(K,) landmarks that at least ``least`` keyframes see."""
    n = problem.initial.n_keyframes
    pairs = np.unique(problem.obs_landmark[keep] * n + problem.obs_keyframe[keep])
    return np.bincount(pairs // n, minlength=problem.initial.n_landmarks) >= least


def without(problem: Problem, keep: NDArray[np.bool_], state: State) -> tuple[Problem, NDArray[np.int64]]:
    """The problem with the observations ``keep`` (M,) only, started at ``state``; and its landmarks."""
    landmarks, number = np.unique(problem.obs_landmark[keep], return_inverse=True)
    reduced = replace(
        problem,
        initial=_with_landmarks(state, state.X_W[landmarks]),
        obs_keyframe=problem.obs_keyframe[keep],
        obs_camera=problem.obs_camera[keep],
        obs_landmark=number.astype(np.int64),
        obs_uv=problem.obs_uv[keep],
        obs_noise=None if problem.obs_noise is None else problem.obs_noise[keep],
    )
    return reduced, landmarks


def _with_landmarks(state: State, X_W: Array) -> State:
    """The motion of a state with landmarks (K, 3), first rotation its own reference."""
    return State.start(state.p_W, state.R_WB, state.v_W, X_W, state.gyro_bias, state.accel_bias)
