"""Preintegration errors (Forster et al., the paper's [5]) and their share of the normal equations.

The ``inputs`` of kernels are the arrays of :class:`vigauge.model.problem.InertialFactors`, gravity in m/s^2,
and positions (N, 3), rotations (N, 3, 3) and velocities (N, 3) of the keyframes. They come one by one: the
type of a tuple costs more to find than a short kernel to run.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..geometry.so3 import Array
from . import rotation
from .compiled import kernel, part
from .lanes import Index
from .sizes import KEYFRAME, POSE


@part
def error_of(
    i: int,
    j: int,
    dt: float,
    dp: Array,
    dR: Array,
    dv: Array,
    gravity: float,
    p_W: Array,
    R_WB: Array,
    v_W: Array,
    shift: Array,
    change: Array,
    turn: Array,
    scratch: Array,
) -> None:
    """Predicted shift and change of velocity in the first frame, and the rotation error."""
    R_i, R_j = R_WB[i], R_WB[j]
    x = p_W[j, 0] - p_W[i, 0] - v_W[i, 0] * dt
    y = p_W[j, 1] - p_W[i, 1] - v_W[i, 1] * dt
    z = p_W[j, 2] - p_W[i, 2] - v_W[i, 2] * dt + 0.5 * gravity * dt * dt
    a = v_W[j, 0] - v_W[i, 0]
    b = v_W[j, 1] - v_W[i, 1]
    c = v_W[j, 2] - v_W[i, 2] + gravity * dt
    for r in range(3):
        shift[r] = R_i[0, r] * x + R_i[1, r] * y + R_i[2, r] * z
        change[r] = R_i[0, r] * a + R_i[1, r] * b + R_i[2, r] * c
    # dR^T R_i^T R_j
    for r in range(3):
        for s in range(3):
            scratch[r, s] = R_i[0, r] * R_j[0, s] + R_i[1, r] * R_j[1, s] + R_i[2, r] * R_j[2, s]
    for s in range(3):
        x, y, z = scratch[0, s], scratch[1, s], scratch[2, s]
        for r in range(3):
            scratch[r, s] = dR[0, r] * x + dR[1, r] * y + dR[2, r] * z
    rotation.log(scratch, turn)


@kernel
def residuals(out: Array, *inputs: Any) -> None:
    """Whitened errors into ``out`` (F, 9), order (position, rotation, velocity)."""
    first, second, dt, dp, dR, dv, whitener, gravity, p_W, R_WB, v_W = inputs
    shift, change, turn, error = np.empty(3), np.empty(3), np.empty(3), np.empty(9)
    scratch = np.empty((3, 3))
    for f in range(len(dt)):
        i, j = first[f], second[f]
        error_of(i, j, dt[f], dp[f], dR[f], dv[f], gravity, p_W, R_WB, v_W, shift, change, turn, scratch)
        for a in range(3):
            error[a], error[3 + a], error[6 + a] = shift[a] - dp[f, a], turn[a], change[a] - dv[f, a]
        for a in range(9):
            value = 0.0
            for b in range(a + 1):
                value += whitener[f, a, b] * error[b]
            out[f, a] = value


@kernel
def cost(*inputs: Any) -> float:
    """Sum of squares of :func:`residuals`."""
    white = np.empty((len(inputs[0]), KEYFRAME))
    residuals(white, *inputs)
    squares = 0.0
    for f in range(len(white)):
        for a in range(KEYFRAME):
            squares += white[f, a] * white[f, a]
    return squares


@part
def jacobian_of(
    dt: float, R_i: Array, R_j: Array, shift: Array, change: Array, inverse: Array, end: int, J: Array
) -> None:
    """Derivative of the nine errors by (position, rotation, velocity) of both keyframes, left increments.

    The second keyframe's columns begin at ``end``. R_i^T hat(a_W) = hat(R_i^T a_W) R_i^T; entries that are
    always zero are left alone.
    """
    for b in range(3):
        x, y, z = R_i[b, 0], R_i[b, 1], R_i[b, 2]
        for a in range(3):
            J[a, b] = -R_i[b, a]
            J[a, 6 + b] = -R_i[b, a] * dt
            J[6 + a, 6 + b] = -R_i[b, a]
            J[a, end + b] = R_i[b, a]
            J[6 + a, end + 6 + b] = R_i[b, a]
            turned = inverse[a, 0] * R_j[b, 0] + inverse[a, 1] * R_j[b, 1] + inverse[a, 2] * R_j[b, 2]
            J[3 + a, 3 + b] = -turned
            J[3 + a, end + 3 + b] = turned
        J[0, 3 + b] = shift[1] * z - shift[2] * y
        J[1, 3 + b] = shift[2] * x - shift[0] * z
        J[2, 3 + b] = shift[0] * y - shift[1] * x
        J[6, 3 + b] = change[1] * z - change[2] * y
        J[7, 3 + b] = change[2] * x - change[0] * z
        J[8, 3 + b] = change[0] * y - change[1] * x


@part
def _add_own(
    product: Array,
    first: int,
    count: int,
    error: int,
    at: int,
    stride: int,
    storage: Array,
    gradient: Array,
) -> None:
    """Add columns ``first``.. of a product to the stored triangle from ``at`` on, J^T r to the gradient."""
    for c in range(count):
        gradient[at + c] += product[first + c, error]
        for r in range(c, count):
            storage[(at + c) * stride + at + r] += product[first + c, first + r]


@part
def _add_block(
    product: Array,
    first: int,
    count: int,
    at: int,
    second: int,
    counts: int,
    to: int,
    stride: int,
    storage: Array,
) -> None:
    """Add a product's rows ``first``.. and columns ``second``.. to the stored triangle, ``at`` and ``to``."""
    if at < to:
        for c in range(count):
            for r in range(counts):
                storage[(at + c) * stride + to + r] += product[first + c, second + r]
    else:
        for r in range(counts):
            for c in range(count):
                storage[(to + r) * stride + at + c] += product[first + c, second + r]


@part
def add_products(
    size: int,
    i: int,
    j: int,
    whitener: Array,
    width: int,
    J: Array,
    W_J: Array,
    product: Array,
    pose: Index,
    speed: Index,
    stride: int,
    storage: Array,
    gradient: Array,
) -> None:
    """Add J^T J and J^T r of one factor to the stored lower triangle and the gradient.

    ``J``, ``W_J`` (size, width): columns of keyframe i, of keyframe j, and the error, so that J^T J holds
    the gradient too; ``product`` (2 size, width) is scratch, its upper triangle is filled. ``width``, the
    length of a row, must be no constant, of which the compiler would make single instructions.
    """
    W_J[:] = 0.0
    for a in range(size):
        for b in range(a // 3 * 3, a + 1):
            w = whitener[a, b]
            for c in range(width):
                W_J[a, c] += w * J[b, c]
        for b in range(0, a // 3 * 3, 3):
            u, v, w = whitener[a, b], whitener[a, b + 1], whitener[a, b + 2]
            for c in range(width):
                W_J[a, c] += u * J[b, c] + v * J[b + 1, c] + w * J[b + 2, c]
    # Three rows at a time, and of each row the whole vectors that reach the diagonal.
    product[:] = 0.0
    for begin in range(0, 2 * size, 8):
        length = width - begin
        for r in range(begin, min(begin + 8, 2 * size)):
            for a in range(0, size, 3):
                u, v, w = W_J[a, r], W_J[a + 1, r], W_J[a + 2, r]
                for k in range(length):
                    c = begin + k
                    product[r, c] += u * W_J[a, c] + v * W_J[a + 1, c] + w * W_J[a + 2, c]
    # The sizes of blocks are constants here, and their loops single instructions.
    speeds, end = size - POSE, size + POSE
    pose_i, speed_i, pose_j, speed_j = pose[i], speed[i], pose[j], speed[j]
    _add_own(product, 0, POSE, 2 * size, pose_i, stride, storage, gradient)
    _add_own(product, POSE, speeds, 2 * size, speed_i, stride, storage, gradient)
    _add_own(product, size, POSE, 2 * size, pose_j, stride, storage, gradient)
    _add_own(product, end, speeds, 2 * size, speed_j, stride, storage, gradient)
    _add_block(product, 0, POSE, pose_i, POSE, speeds, speed_i, stride, storage)
    _add_block(product, 0, POSE, pose_i, size, POSE, pose_j, stride, storage)
    _add_block(product, 0, POSE, pose_i, end, speeds, speed_j, stride, storage)
    _add_block(product, POSE, speeds, speed_i, size, POSE, pose_j, stride, storage)
    _add_block(product, POSE, speeds, speed_i, end, speeds, speed_j, stride, storage)
    _add_block(product, size, POSE, pose_j, end, speeds, speed_j, stride, storage)


# Length of a row of J: 18 columns and the error, in whole vectors of eight.
_ROW = 24


@kernel
def accumulate(pose: Index, speed: Index, stride: int, storage: Array, gradient: Array, *inputs: Any) -> None:
    """Add J^T J and J^T r of every factor to the stored lower triangle and the gradient (9N,).

    ``pose`` and ``speed`` (N,) first stored column of each keyframe's pose and velocity; entry (r, c) is
    ``storage[c * stride + r]``.
    """
    first, second, dt, dp, dR, dv, whitener, gravity, p_W, R_WB, v_W = inputs
    shift, change, turn, scratch = np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3))
    inverse, J = np.empty((3, 3)), np.zeros((KEYFRAME, _ROW))
    W_J, product = np.empty((KEYFRAME, _ROW)), np.empty((2 * KEYFRAME, _ROW))
    width = _ROW - KEYFRAME + whitener.shape[1]
    for f in range(len(dt)):
        i, j = first[f], second[f]
        error_of(i, j, dt[f], dp[f], dR[f], dv[f], gravity, p_W, R_WB, v_W, shift, change, turn, scratch)
        rotation.right_jacobian_inverse(turn, inverse)
        jacobian_of(dt[f], R_WB[i], R_WB[j], shift, change, inverse, KEYFRAME, J)
        for a in range(3):
            J[a, 18], J[3 + a, 18], J[6 + a, 18] = shift[a] - dp[f, a], turn[a], change[a] - dv[f, a]
        add_products(
            KEYFRAME, i, j, whitener[f], width, J, W_J, product, pose, speed, stride, storage, gradient
        )
