"""As :mod:`.inertial` where biases are estimated: 15 errors a factor, 15 parameters a keyframe.

The increments follow a keyframe's biases to first order from those that they were integrated at (Forster
et al., Eq. 44). The last six errors are the steps of the biases' random walk.

Of the ``inputs`` the whitener is (F, 15, 15). Between increments and motion stand ``by_bias`` (F, 9, 6), the
increments' derivative by the gyroscope's and the accelerometer's bias, and ``bias`` (F, 6), where they were
integrated; after the motion both biases of the keyframes, (N, 3) each.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..geometry.so3 import Array
from . import rotation
from .compiled import kernel, part
from .inertial import add_products, error_of, jacobian_of
from .lanes import Index
from .sizes import WITH_BIASES


@part
def _error_of(
    f: int,
    inputs: Any,
    shift: Array,
    change: Array,
    turn: Array,
    scratch: Array,
    moved: Array,
    dp_f: Array,
    dR_f: Array,
    dv_f: Array,
) -> None:
    """As :func:`.inertial.error_of`, with the increments at the first keyframe's biases.

    These go into ``dp_f``, ``dR_f`` and ``dv_f``, and their change into ``moved`` (9,).
    """
    first, second, dt, dp, dR, dv, _, gravity, by_bias, bias, p_W, R_WB, v_W, gyro_bias, accel_bias = inputs
    i = first[f]
    for r in range(9):
        moved[r] = 0.0
        for c in range(3):
            moved[r] += by_bias[f, r, c] * (gyro_bias[i, c] - bias[f, c])
            moved[r] += by_bias[f, r, 3 + c] * (accel_bias[i, c] - bias[f, 3 + c])
    rotation.exp(moved[3:6], scratch)
    for a in range(3):
        dp_f[a], dv_f[a] = dp[f, a] + moved[a], dv[f, a] + moved[6 + a]
        for b in range(3):
            dR_f[a, b] = (
                dR[f, a, 0] * scratch[0, b] + dR[f, a, 1] * scratch[1, b] + dR[f, a, 2] * scratch[2, b]
            )
    error_of(i, second[f], dt[f], dp_f, dR_f, dv_f, gravity, p_W, R_WB, v_W, shift, change, turn, scratch)


@kernel
def residuals(out: Array, *inputs: Any) -> None:
    """Whitened errors into ``out`` (F, 15): position, rotation, velocity, steps of both biases."""
    first, second, dt, _, _, _, whitener, _, _, _, _, _, _, gyro_bias, accel_bias = inputs
    shift, change, turn, error = np.empty(3), np.empty(3), np.empty(3), np.empty(15)
    scratch, moved = np.empty((3, 3)), np.empty(9)
    dp_f, dR_f, dv_f = np.empty(3), np.empty((3, 3)), np.empty(3)
    for f in range(len(dt)):
        i, j = first[f], second[f]
        _error_of(f, inputs, shift, change, turn, scratch, moved, dp_f, dR_f, dv_f)
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
def cost(*inputs: Any) -> float:
    """Sum of squares of :func:`residuals`."""
    white = np.empty((len(inputs[0]), WITH_BIASES))
    residuals(white, *inputs)
    squares = 0.0
    for f in range(len(white)):
        for a in range(WITH_BIASES):
            squares += white[f, a] * white[f, a]
    return squares


# Length of a row of J: 30 columns and the error, in whole vectors of eight.
_ROW = 32


@kernel
def accumulate(pose: Index, speed: Index, stride: int, storage: Array, gradient: Array, *inputs: Any) -> None:
    """Add J^T J and J^T r of every factor to the stored lower triangle and the gradient (15N,).

    ``pose`` and ``speed`` (N,) first stored column of each keyframe's pose, and of its velocity and biases;
    entry (r, c) is ``storage[c * stride + r]``.
    """
    first, second, dt, _, _, _, whitener, _, by_bias, _, _, R_WB, _, gyro_bias, accel_bias = inputs
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
        _error_of(f, inputs, shift, change, turn, scratch, moved, dp_f, dR_f, dv_f)
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
            WITH_BIASES, i, j, whitener[f], width, J, W_J, product, pose, speed, stride, storage, gradient
        )
