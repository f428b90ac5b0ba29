"""Standard deviations of keyframes, as Figs. 9 and 10 have them on the diagonal."""

from collections.abc import Iterable

import numpy as np

from vigauge.covariance.covariance import motion_covariance
from vigauge.gauge.gauges import FixedGauge, FreeGauge
from vigauge.geometry.so3 import Array
from vigauge.model.problem import Problem
from vigauge.solver.levenberg_marquardt import Options, solve


def deviations(covariance: Array) -> Array:
    """(N, 3) of a (9N, 9N) covariance: of position (m), rotation (rad) and velocity (m/s) of each keyframe.

    Root of the trace of its block.
    """
    variance = np.diagonal(covariance).reshape(3, -1, 3).sum(axis=2)
    return np.sqrt(np.maximum(variance, 0.0)).T


def of_trials(problems: Iterable[Problem], options: Options) -> dict[str, Array]:
    """(T, N, 3) of every problem in the free and the fixed gauge, each at its own estimate."""
    out: dict[str, list[Array]] = {"free": [], "fixed": []}
    for problem in problems:
        for panel, gauge in (("free", FreeGauge()), ("fixed", FixedGauge())):
            state = solve(problem, gauge, options).state
            out[panel].append(deviations(motion_covariance(problem, state, gauge)))
    return {panel: np.array(found) for panel, found in out.items()}
