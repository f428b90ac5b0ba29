"""As :mod:`.inertial` where biases are estimated: 15 errors a factor, 15 parameters a keyframe.

The increments follow a keyframe's biases to first order from those that they were integrated at (Forster
et al., Eq. 44). The last six errors are the steps of the biases' random walk.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..geometry.so3 import Array
from . import rotation
from .compiled import kernel, part
from .inertial import add_products, error_of, jacobian_of
from .lanes import Index
from .sizes import WITH_BIASES


class BiasedIncrements(NamedTuple):
    """As :class:`.inertial.Increments`, with a whitener (F, 15, 15).

    ``by_bias`` (F, 9, 6): their derivative by the gyroscope's and the accelerometer's bias; ``bias`` (F, 6):
    where they were integrated.
    """

    first: Index
    second: Index
    dt: Array
    dp: Array
    dR: Array
    dv: Array
    whitener: Array
    gravity: float
    by_bias: Array
    bias: Array


@part
def _corrected(
    dp: Array,
    dR: Array,
    dv: Array,
    by_bias: Array,
    bias: Array,
    gyro_bias: Array,
    accel_bias: Array,
    moved: Array,
    exp: Array,
    dp_out: Array,
    dR_out: Array,
    dv_out: Array,
) -> None:
    """Increments at a keyframe's biases; ``moved`` (9,) is their change, ``exp`` scratch."""
    for r in range(9):
        moved[r] = 0.0
        for c in range(3):
            moved[r] += by_bias[r, c] * (gyro_bias[c] - bias[c])
            moved[r] += by_bias[r, 3 + c] * (accel_bias[c] - bias[3 + c])
    rotation.exp(moved[3:6], exp)
    for a in range(3):
        dp_out[a], dv_out[a] = dp[a] + moved[a], dv[a] + moved[6 + a]
        for b in range(3):
            dR_out[a, b] = dR[a, 0] * exp[0, b] + dR[a, 1] * exp[1, b] + dR[a, 2] * exp[2, b]


@kernel
def residuals(
    first: Index,
    second: Index,
    dt: Array,
    dp: Array,
    dR: Array,
    dv: Array,
    whitener: Array,
    gravity: float,
    by_bias: Array,
    bias: Array,
    p_W: Array,
    R_WB: Array,
    v_W: Array,
    gyro_bias: Array,
    accel_bias: Array,
    out: Array,
) -> None:
    """Whitened errors into ``out`` (F, 15): position, rotation, velocity, steps of both biases."""
    shift, change, turn, error = np.empty(3), np.empty(3), np.empty(3), np.empty(15)
    scratch, moved, dp_f, dR_f, dv_f = (
        np.empty((3, 3)),
        np.empty(9),
        np.empty(3),
        np.empty((3, 3)),
        np.empty(3),
    )
    for f in range(len(dt)):
        i, j = first[f], second[f]
        _corrected(
            dp[f],
            dR[f],
            dv[f],
            by_bias[f],
            bias[f],
            gyro_bias[i],
            accel_bias[i],
            moved,
            scratch,
            dp_f,
            dR_f,
            dv_f,
        )
        error_of(i, j, dt[f], dp_f, dR_f, dv_f, gravity, p_W, R_WB, v_W, shift, change, turn, scratch)
        for a in range(3):
            error[a], error[3 + a], error[6 + a] = shift[a] - dp_f[a], turn[a], change[a] - dv_f[a]
            error[9 + a] = gyro_bias[j, a] - gyro_bias[i, a]
            error[12 + a] = accel_bias[j, a] - accel_bias[i, a]
        for a in range(WITH_BIASES):
            value = 0.0
            for b in range(a + 1):
                value += whitener[f, a, b] * error[b]
            out[f, a] = value


@kernel
def cost(
    first: Index,
    second: Index,
    dt: Array,
    dp: Array,
    dR: Array,
    dv: Array,
    whitener: Array,
    gravity: float,
    by_bias: Array,
    bias: Array,
    p_W: Array,
    R_WB: Array,
    v_W: Array,
    gyro_bias: Array,
    accel_bias: Array,
) -> float:
    """Sum of squares of :func:`residuals`."""
    white = np.empty((len(dt), WITH_BIASES))
    residuals(
        first,
        second,
        dt,
        dp,
        dR,
        dv,
        whitener,
        gravity,
        by_bias,
        bias,
        p_W,
        R_WB,
        v_W,
        gyro_bias,
        accel_bias,
        white,
    )
    squares = 0.0
    for f in range(len(white)):
        for a in range(WITH_BIASES):
            squares += white[f, a] * white[f, a]
    return squares


# Length of a row of J: 30 columns and the error, in whole vectors of eight.
_ROW = 32


@kernel
def accumulate(
    first: Index,
    second: Index,
    dt: Array,
    dp: Array,
    dR: Array,
    dv: Array,
    whitener: Array,
    gravity: float,
    by_bias: Array,
    bias: Array,
    p_W: Array,
    R_WB: Array,
    v_W: Array,
    gyro_bias: Array,
    accel_bias: Array,
    column: Index,
    stride: int,
    storage: Array,
    gradient: Array,
) -> None:
    """Add J^T J and J^T r of every factor to the stored lower triangle and the gradient (15N,).

    ``column`` (N,) first stored column of each keyframe; entry (r, c) is ``storage[c * stride + r]``.
    """
    shift, change, turn, scratch = np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3))
    moved, dp_f, dR_f, dv_f = np.empty(9), np.empty(3), np.empty((3, 3)), np.empty(3)
    inverse, left, chain = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    J, W_J = np.zeros((WITH_BIASES, _ROW)), np.empty((WITH_BIASES, _ROW))
    product = np.empty((2 * WITH_BIASES, _ROW))
    for a in range(6):
        J[9 + a, 9 + a], J[9 + a, WITH_BIASES + 9 + a] = -1.0, 1.0
    width = _ROW - WITH_BIASES + whitener.shape[1]
    for f in range(len(dt)):
        i, j = first[f], second[f]
        _corrected(
            dp[f],
            dR[f],
            dv[f],
            by_bias[f],
            bias[f],
            gyro_bias[i],
            accel_bias[i],
            moved,
            scratch,
            dp_f,
            dR_f,
            dv_f,
        )
        error_of(i, j, dt[f], dp_f, dR_f, dv_f, gravity, p_W, R_WB, v_W, shift, change, turn, scratch)
        rotation.right_jacobian_inverse(turn, inverse)
        jacobian_of(dt[f], R_WB[i], R_WB[j], shift, change, inverse, WITH_BIASES, J)
        # The rotation's error Log(Exp(-m) E) changes with m, in ``moved``, by -J_l^-1(error) J_r(m) dm. Both
        # are transposes: of J_r^-1 and of J_l.
        rotation.left_jacobian(moved[3:6], left)
        for a in range(3):
            for b in range(3):
                chain[a, b] = (
                    inverse[0, a] * left[b, 0] + inverse[1, a] * left[b, 1] + inverse[2, a] * left[b, 2]
                )
        for a in range(3):
            for c in range(6):
                J[a, 9 + c], J[6 + a, 9 + c] = -by_bias[f, a, c], -by_bias[f, 6 + a, c]
                turned = chain[a, 0] * by_bias[f, 3, c] + chain[a, 1] * by_bias[f, 4, c]
                J[3 + a, 9 + c] = -turned - chain[a, 2] * by_bias[f, 5, c]
            J[a, 30], J[3 + a, 30], J[6 + a, 30] = shift[a] - dp_f[a], turn[a], change[a] - dv_f[a]
            J[9 + a, 30] = gyro_bias[j, a] - gyro_bias[i, a]
            J[12 + a, 30] = accel_bias[j, a] - accel_bias[i, a]
        add_products(
            WITH_BIASES, i, j, whitener[f], width, J, W_J, product, column, stride, storage, gradient
        )
