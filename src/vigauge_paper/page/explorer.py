"""What the gauge explorer computes from: one estimate, its generalised inverse and its null space.

The page does the rest by the formulas of :mod:`vigauge.covariance`: Q G Q^T for a gauge, and four columns
more for a prior. Only the motion is shipped; what the landmarks add to the free gauge of the paper, whose
normal is the whole null space, are 4 x 4 products.
"""

from __future__ import annotations

import base64
from dataclasses import replace

import numpy as np

from vigauge.covariance.covariance import Covariance
from vigauge.geometry import so3
from vigauge.geometry.so3 import Array
from vigauge.model.evaluation import align_all_poses
from vigauge.model.problem import Problem
from vigauge.model.state import State

from ..figures.chart import Chart

# The second set of measurements, for differences of log det: the images, this many times noisier.
NOISIER = 2.0


def packed(array: Array) -> str:
    """Doubles, little end first, row by row, as base64."""
    return base64.b64encode(np.ascontiguousarray(array, dtype="<f8").tobytes()).decode("ascii")


def at_truth(estimate: State, truth: State) -> State:
    """The estimate moved along its orbit to where the truth is: errors are then as small as they can be."""
    return align_all_poses(estimate, truth)


def noisier(problem: Problem) -> Problem:
    """The same problem, believing its images to be :data:`NOISIER` times as noisy."""
    return problem.with_noise(NOISIER * problem.sigma_px, 1.0)


def explorer_data(name: str, problem: Problem, estimate: State, truth: State) -> dict[str, object]:
    """One estimate for the explorer, by JSON's types; matrices are :func:`packed`, symmetric ones by rows
    of the lower triangle.

    ``G``, ``G_noisier``: (9N, 9N) inverses with the first pose held. ``U`` (9N, 4) null space, columns yaw,
    x, y, z. ``G_U`` (9N, 4), ``U_G_U`` and ``U_U`` (4, 4), and the same of the noisier problem: products
    with the landmarks in them. ``error`` (9N,) estimate to truth; ``direction`` (9N,) and ``U_direction``
    (4,): from the minimum to the start, across the orbit (Fig. 8). ``left_jacobian`` (3, 3) of the total
    increment of the first rotation.
    """
    state = at_truth(estimate, truth)
    covariance, changed = Covariance.of(problem, state), Covariance.of(noisier(problem), state)
    n_motion = 9 * state.n_keyframes
    lower = np.tril_indices(n_motion)
    known = replace(truth, X_W=state.X_W) if truth.n_landmarks != state.n_landmarks else truth
    chart = Chart.around(problem, state)
    arrays: dict[str, Array] = {
        "p_W": state.p_W,
        "R_WB": state.R_WB,
        "truth_p_W": truth.p_W,
        "left_jacobian": so3.left_jacobian(state.dphi_0),
        "G": covariance.inverse.dense()[lower],
        "G_noisier": changed.inverse.dense()[lower],
        "U": covariance.U[:n_motion],
        "U_U": covariance.U.T @ covariance.U,
        "error": state.local(known)[:n_motion],
        "direction": chart.direction[:n_motion],
        "U_direction": covariance.U.T @ chart.direction,
    }
    for ending, one in (("", covariance), ("_noisier", changed)):
        arrays[f"G_U{ending}"], arrays[f"U_G_U{ending}"] = _through_landmarks(one)
    if known is truth:
        arrays["U_error"] = covariance.U.T @ state.local(truth)
    return {
        "name": name,
        "withheld": "",
        "keyframes": state.n_keyframes,
        "landmarks": state.n_landmarks,
        "noisier": NOISIER,
        "start_yaw": chart.start_yaw,
        "arrays": {key: packed(array) for key, array in arrays.items()},
    }


def _through_landmarks(covariance: Covariance) -> tuple[Array, Array]:
    """The motion's rows (9N, 4) of G U, and U^T G U (4, 4), for the G of all parameters."""
    n_motion = 9 * covariance.state.n_keyframes
    taken, gram = covariance.reduced.couple(covariance.U[n_motion:])
    through = covariance.U[:n_motion] - taken
    G_U = covariance.inverse.times(through)
    return G_U, gram + through.T @ G_U
