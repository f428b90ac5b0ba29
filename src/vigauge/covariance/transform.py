"""Eq. (12): a covariance at one estimate taken to a gauge, the estimate moved along (Appendix A)."""

from __future__ import annotations

import numpy as np

from ..arrays import instance, symmetric
from ..errors import DataError
from ..gauge.gauges import Gauge
from ..gauge.group import orbit_tangent
from ..geometry import so3
from ..geometry.so3 import Array
from ..model.state import State
from .projection import independent_columns, oblique_projection


def transfer_blocks(state: State, moved: State, yaw: float, count: int) -> Array:
    """(count, 3, 3) diagonal blocks of d(theta_C)/d(theta) (Appendix A); biases stay."""
    blocks = np.broadcast_to(so3.yaw_rotation(yaw), (count, 3, 3)).copy()
    blocks[3 * state.n_keyframes : state.n_motion // 3] = np.eye(3)
    blocks[state.n_keyframes] = so3.right_jacobian_inverse(moved.dphi_0) @ so3.right_jacobian(state.dphi_0)
    return blocks


def transform_covariance(
    covariance: Array, state: State, gauge: Gauge, reference: State
) -> tuple[Array, State]:
    """Eq. (12): a covariance at ``state`` taken to a gauge.

    Parameters
    ----------
    covariance : motion block (9N, 9N), with biases (15N, 15N), or of all n parameters; usually the free one
    state : estimate it belongs to
    gauge : gauge wanted
    reference : state whose first pose the gauge keeps (the initial state of the problem)

    Returns
    -------
    covariance in the gauge, same shape, and theta_C, the estimate moved onto the gauge

    Raises
    ------
    DataError
        for another shape, a matrix that is not symmetric or holds rotations with standard deviations
        beyond pi, or a motion block where the gauge constrains landmarks
    """
    instance("state", state, State).require_valid()
    instance("reference", reference, State).require_valid()
    instance("gauge", gauge, Gauge)
    covariance = symmetric("covariance", covariance)
    n, n_motion = len(covariance), state.n_motion
    if covariance.shape not in ((n_motion, n_motion), (state.n_parameters,) * 2):
        raise DataError(
            "covariance",
            f"shape must be ({n_motion}, {n_motion}) or {(state.n_parameters,) * 2}",
            value=covariance.shape,
        )
    turn = np.diagonal(covariance)[3 * state.n_keyframes : 6 * state.n_keyframes]
    if turn.max() > np.pi**2:
        row = 3 * state.n_keyframes + int(np.argmax(turn))
        rule = "standard deviation of a rotation must be below pi rad; is it an information matrix?"
        raise DataError("covariance", rule, row=row, value=float(np.sqrt(turn.max())))
    moved, yaw = gauge.meet(state, reference)
    V = gauge.normal(moved)
    if n == n_motion and np.any(V[n_motion:]):
        raise DataError(
            "covariance", f"gauge '{gauge.name}' constrains landmarks, so their covariance is needed"
        )
    blocks = transfer_blocks(state, moved, yaw, n // 3)
    carried = (blocks @ covariance.reshape(n // 3, 3, n)).reshape(n, n)
    carried = (blocks @ carried.T.reshape(n // 3, 3, n)).reshape(n, n)
    U, V = independent_columns("U", orbit_tangent(moved)[:n]), independent_columns("V", V[:n])
    return oblique_projection(carried, U, V), moved
