"""How the position variance of the free gauge is spread over the keyframes, and what it goes with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vigauge.covariance.covariance import motion_covariance
from vigauge.gauge.gauges import FreeGauge
from vigauge.geometry.so3 import Array
from vigauge.model.problem import Problem
from vigauge.solver.levenberg_marquardt import Options, solve

Row = dict[str, object]


@dataclass(frozen=True)
class SpreadSettings:
    """Config section 'free_spread': ``draws`` of landmarks and noise of every configuration."""

    draws: int


def position_variances(covariance: Array, keyframes: int) -> Array:
    """(N,) variance of each keyframe's position, m^2: trace of its block of a (9N, 9N) covariance."""
    return np.diagonal(covariance)[: 3 * keyframes].reshape(keyframes, 3).sum(axis=1)


def free_spread(name: str, draw: int, problem: Problem, options: Options) -> Row:
    """Largest over smallest position variance, and how it goes with the place of the points.

    ``correlation`` is that of the variance with the squared distance to the centre of all positions and
    landmarks, over the keyframes: the free gauge holds that centre best.
    """
    solution = solve(problem, FreeGauge(), options)
    state = solution.state
    variance = position_variances(motion_covariance(problem, state, FreeGauge()), state.n_keyframes)
    centre = np.vstack([state.p_W, state.X_W]).mean(axis=0)
    distance = np.sum((state.p_W - centre) ** 2, axis=1)
    return {
        "experiment": name,
        "draw": draw,
        "converged": solution.converged,
        "ratio": float(variance.max() / variance.min()),
        "correlation": float(np.corrcoef(distance, variance)[0, 1]),
    }
