"""Reprojection errors, and their share of the normal equations, without a Jacobian in memory.

With ray = X - p in W and M = J_l^T J_l, where J_l is the Jacobian of an observation by its
landmark, the Jacobian by the pose is J_l [-I, hat(ray)]. So H needs M only:
landmark block M, coupling [-M; -hat(ray) M], pose block [[M, .], [hat(ray) M, -hat(ray) M hat(ray)]].
The cameras of a keyframe share the ray, so M is summed over them: six numbers a pair of keyframe
and landmark, (00, 01, 02, 11, 12, 22), are all that is kept of its observations.

The sums run over cells, see :mod:`.lanes`.
"""

from __future__ import annotations

import math

import numpy as np

from ..geometry.so3 import Array
from .compiled import kernel, part
from .lanes import LANES as L
from .lanes import Index, gather_points
from .loss import rho, root_weight

# Entries of a keyframe's accumulator: M (6), hat(ray) M (9), rotation block (6), both gradients (6).
POSE_ENTRIES = 27


@part
def camera_rotations(R_WB: Array, R_BC: Array, R_CW: Array) -> None:
    """R_CW (C, N, 3, 3) of every camera at every keyframe."""
    for c in range(R_BC.shape[0]):
        for i in range(R_WB.shape[0]):
            for a in range(3):
                for b in range(3):
                    R_CW[c, i, a, b] = (
                        R_BC[c, 0, a] * R_WB[i, b, 0]
                        + R_BC[c, 1, a] * R_WB[i, b, 1]
                        + R_BC[c, 2, a] * R_WB[i, b, 2]
                    )


@part
def _seen(
    x: float,
    y: float,
    z: float,
    w: float,
    R: tuple[float, ...],
    t: tuple[float, float, float],
) -> tuple[float, float, float]:
    """Normalised coordinates and inverse depth of a ray from the body, by a camera's R_CW and p_CB.

    Empty lanes (w = 0) may hold any point; depth is replaced by 1 to avoid dividing by zero.
    """
    depth = R[6] * x + R[7] * y + R[8] * z + t[2]
    inverse_depth = 1.0 / (depth if w > 0.0 else 1.0)
    u = (R[0] * x + R[1] * y + R[2] * z + t[0]) * inverse_depth
    v = (R[3] * x + R[4] * y + R[5] * z + t[1]) * inverse_depth
    return u, v, inverse_depth


@part
def _rotation(c: int, k: int, R_CW: Array) -> tuple[float, ...]:
    """Rows of the rotation of camera c at keyframe k, as numbers that loops keep in registers."""
    return (
        R_CW[c, k, 0, 0],
        R_CW[c, k, 0, 1],
        R_CW[c, k, 0, 2],
        R_CW[c, k, 1, 0],
        R_CW[c, k, 1, 1],
        R_CW[c, k, 1, 2],
        R_CW[c, k, 2, 0],
        R_CW[c, k, 2, 1],
        R_CW[c, k, 2, 2],
    )


@kernel
def residuals(
    p_W: Array,
    X_W: Array,
    R_CW: Array,
    p_CB: Array,
    intrinsics: Array,
    keyframe: Index,
    camera: Index,
    landmark: Index,
    uv: Array,
    weight: Array,
    out: Array,
) -> None:
    """Whitened errors into ``out`` (M, 2), from observations in the problem's order."""
    for m in range(uv.shape[0]):
        k, c, j = keyframe[m], camera[m], landmark[m]
        x, y, z = X_W[j, 0] - p_W[k, 0], X_W[j, 1] - p_W[k, 1], X_W[j, 2] - p_W[k, 2]
        t = (p_CB[c, 0], p_CB[c, 1], p_CB[c, 2])
        u, v, _ = _seen(x, y, z, 1.0, _rotation(c, k, R_CW), t)
        r_u = (intrinsics[c, 0] * u + intrinsics[c, 2] - uv[m, 0]) * weight[m]
        r_v = (intrinsics[c, 1] * v + intrinsics[c, 3] - uv[m, 1]) * weight[m]
        out[m, 0], out[m, 1] = r_u, r_v


@kernel
def cost(
    p_W: Array,
    R_WB: Array,
    X_W: Array,
    R_BC: Array,
    p_CB: Array,
    intrinsics: Array,
    pixels: Array,
    huber: float | None,
    cauchy: float | None,
    R_CW: Array,
    *batches: Index,
) -> tuple[float, float]:
    """Sum of squares of :func:`residuals`, each through the loss, and of their lengths.

    ``pixels`` (V, 3 L) as of the problem; ``R_CW`` is filled by :func:`camera_rotations`.
    """
    order, batch_begin, batch_cell, cell_keyframe, _, cell_view, view_camera = batches
    camera_rotations(R_WB, R_BC, R_CW)
    lanes = pixels.shape[1] // 3
    s = np.empty(3 * L)
    squares, lengths = 0.0, 0.0
    for b in range(len(batch_begin) - 1):
        gather_points(batch_begin[b], batch_begin[b + 1] - 1, order, X_W, lanes, s)
        for cell in range(batch_cell[b], batch_cell[b + 1]):
            k = cell_keyframe[cell]
            px, py, pz = p_W[k, 0], p_W[k, 1], p_W[k, 2]
            for view in range(cell_view[cell], cell_view[cell + 1]):
                c = view_camera[view]
                R, t = _rotation(c, k, R_CW), (p_CB[c, 0], p_CB[c, 1], p_CB[c, 2])
                fx, fy, cx, cy = intrinsics[c, 0], intrinsics[c, 1], intrinsics[c, 2], intrinsics[c, 3]
                for i in range(lanes):
                    x, y, z = s[i] - px, s[L + i] - py, s[2 * L + i] - pz
                    w = pixels[view, 2 * L + i]
                    u, v, _ = _seen(x, y, z, w, R, t)
                    r_u = (fx * u + cx - pixels[view, i]) * w
                    r_v = (fy * v + cy - pixels[view, L + i]) * w
                    square = r_u * r_u + r_v * r_v
                    squares += rho(square, huber, cauchy)
                    lengths += math.sqrt(square)
    return squares, lengths


# Rows of the scratch of `accumulate`, which see.
_RAY, _CELL, _BATCH, _ROWS = 3 * L, 6 * L, 15 * L, 24


@part
def _add_view(
    view: int,
    k: int,
    c: int,
    R_CW: Array,
    p_CB: Array,
    intrinsics: Array,
    pixels: Array,
    huber: float | None,
    cauchy: float | None,
    s: Array,
) -> None:
    """Add M and J_l^T r of a view's observations to the cell's rows of ``s``.

    The rows of J_l are a = f_x w / depth (R_0 - u R_2), w the weight of a pixel, and b alike. A loss scales
    all of them, see :mod:`.loss`.
    """
    lanes = pixels.shape[1] // 3
    R, t = _rotation(c, k, R_CW), (p_CB[c, 0], p_CB[c, 1], p_CB[c, 2])
    fx, fy, cx, cy = intrinsics[c, 0], intrinsics[c, 1], intrinsics[c, 2], intrinsics[c, 3]
    for i in range(lanes):
        x, y, z = s[_RAY + i], s[_RAY + L + i], s[_RAY + 2 * L + i]
        w = pixels[view, 2 * L + i]
        u, v, inverse_depth = _seen(x, y, z, w, R, t)
        r_u = (fx * u + cx - pixels[view, i]) * w
        r_v = (fy * v + cy - pixels[view, L + i]) * w
        root = root_weight(r_u * r_u + r_v * r_v, huber, cauchy)
        r_u, r_v, w = r_u * root, r_v * root, w * root
        p, q = fx * w * inverse_depth, fy * w * inverse_depth
        a0, a1, a2 = (R[0] - u * R[6]) * p, (R[1] - u * R[7]) * p, (R[2] - u * R[8]) * p
        b0, b1, b2 = (R[3] - v * R[6]) * q, (R[4] - v * R[7]) * q, (R[5] - v * R[8]) * q
        s[_CELL + i] += a0 * a0 + b0 * b0
        s[_CELL + L + i] += a0 * a1 + b0 * b1
        s[_CELL + 2 * L + i] += a0 * a2 + b0 * b2
        s[_CELL + 3 * L + i] += a1 * a1 + b1 * b1
        s[_CELL + 4 * L + i] += a1 * a2 + b1 * b2
        s[_CELL + 5 * L + i] += a2 * a2 + b2 * b2
        s[_CELL + 6 * L + i] += a0 * r_u + b0 * r_v
        s[_CELL + 7 * L + i] += a1 * r_u + b1 * r_v
        s[_CELL + 8 * L + i] += a2 * r_u + b2 * r_v


@part
def _add_to_pose(k: int, lanes: int, s: Array, pose: Array) -> None:
    """Sums over a cell's lanes to the accumulator of its keyframe."""
    s00, s01, s02, s11, s12, s22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    t00, t01, t02, t10, t11, t12, t20, t21, t22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(lanes):
        x, y, z = s[_RAY + i], s[_RAY + L + i], s[_RAY + 2 * L + i]
        m00, m01, m02 = s[_CELL + i], s[_CELL + L + i], s[_CELL + 2 * L + i]
        m11, m12, m22 = s[_CELL + 3 * L + i], s[_CELL + 4 * L + i], s[_CELL + 5 * L + i]
        s00 += m00
        s01 += m01
        s02 += m02
        s11 += m11
        s12 += m12
        s22 += m22
        t00 += y * m02 - z * m01
        t01 += y * m12 - z * m11
        t02 += y * m22 - z * m12
        t10 += z * m00 - x * m02
        t11 += z * m01 - x * m12
        t12 += z * m02 - x * m22
        t20 += x * m01 - y * m00
        t21 += x * m11 - y * m01
        t22 += x * m12 - y * m02
    pose[k, 0] += s00
    pose[k, 1] += s01
    pose[k, 2] += s02
    pose[k, 3] += s11
    pose[k, 4] += s12
    pose[k, 5] += s22
    pose[k, 6] += t00
    pose[k, 7] += t01
    pose[k, 8] += t02
    pose[k, 9] += t10
    pose[k, 10] += t11
    pose[k, 11] += t12
    pose[k, 12] += t20
    pose[k, 13] += t21
    pose[k, 14] += t22
    # -hat(ray) M hat(ray), symmetric
    e00, e01, e02, e11, e12, e22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    g0, g1, g2, h0, h1, h2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(lanes):
        x, y, z = s[_RAY + i], s[_RAY + L + i], s[_RAY + 2 * L + i]
        m00, m01, m02 = s[_CELL + i], s[_CELL + L + i], s[_CELL + 2 * L + i]
        m11, m12, m22 = s[_CELL + 3 * L + i], s[_CELL + 4 * L + i], s[_CELL + 5 * L + i]
        q0, q1, q2 = s[_CELL + 6 * L + i], s[_CELL + 7 * L + i], s[_CELL + 8 * L + i]
        e00 += y * (y * m22 - z * m12) - z * (y * m12 - z * m11)
        e01 += z * (y * m02 - z * m01) - x * (y * m22 - z * m12)
        e02 += x * (y * m12 - z * m11) - y * (y * m02 - z * m01)
        e11 += z * (z * m00 - x * m02) - x * (z * m02 - x * m22)
        e12 += x * (z * m01 - x * m12) - y * (z * m00 - x * m02)
        e22 += x * (x * m11 - y * m01) - y * (x * m01 - y * m00)
        g0 += q0
        g1 += q1
        g2 += q2
        h0 += q1 * z - q2 * y
        h1 += q2 * x - q0 * z
        h2 += q0 * y - q1 * x
    pose[k, 15] += e00
    pose[k, 16] += e01
    pose[k, 17] += e02
    pose[k, 18] += e11
    pose[k, 19] += e12
    pose[k, 20] += e22
    pose[k, 21] -= g0
    pose[k, 22] -= g1
    pose[k, 23] -= g2
    pose[k, 24] += h0
    pose[k, 25] += h1
    pose[k, 26] += h2


@kernel
def accumulate(
    p_W: Array,
    X_W: Array,
    R_CW: Array,
    p_CB: Array,
    intrinsics: Array,
    pixels: Array,
    huber: float | None,
    cauchy: float | None,
    first_batch: int,
    end_batch: int,
    information: Array,
    landmark: Array,
    landmark_gradient: Array,
    pose: Array,
    *batches: Index,
) -> None:
    """Sums over a range of batches: ``information`` (Q, 6 L), landmarks' blocks and gradients, ``pose``.

    ``pose`` (N, 27) takes each keyframe's sums. Rows of the scratch: X (3), ray (3), M and
    J_l^T r of the cell (9), and their sums over the batch (9).
    """
    order, batch_begin, batch_cell, cell_keyframe, _, cell_view, view_camera = batches
    lanes = pixels.shape[1] // 3
    s = np.empty(_ROWS * L)
    for b in range(first_batch, end_batch):
        first, end = batch_begin[b], batch_begin[b + 1]
        gather_points(first, end - 1, order, X_W, lanes, s)
        for i in range(9 * lanes):
            s[_BATCH + i] = 0.0
        for cell in range(batch_cell[b], batch_cell[b + 1]):
            k = cell_keyframe[cell]
            px, py, pz = p_W[k, 0], p_W[k, 1], p_W[k, 2]
            for i in range(lanes):
                s[_RAY + i] = s[i] - px
                s[_RAY + L + i] = s[L + i] - py
                s[_RAY + 2 * L + i] = s[2 * L + i] - pz
            for i in range(9 * lanes):
                s[_CELL + i] = 0.0
            for view in range(cell_view[cell], cell_view[cell + 1]):
                _add_view(view, k, view_camera[view], R_CW, p_CB, intrinsics, pixels, huber, cauchy, s)
            for i in range(9 * lanes):
                s[_BATCH + i] += s[_CELL + i]
            for i in range(6 * lanes):
                information[cell, i] = s[_CELL + i]
            _add_to_pose(k, lanes, s, pose)
        for i in range(end - first):
            j = order[first + i]
            c01, c02, c12 = s[_BATCH + L + i], s[_BATCH + 2 * L + i], s[_BATCH + 4 * L + i]
            landmark[j, 0, 0], landmark[j, 0, 1], landmark[j, 0, 2] = s[_BATCH + i], c01, c02
            landmark[j, 1, 0], landmark[j, 1, 1], landmark[j, 1, 2] = c01, s[_BATCH + 3 * L + i], c12
            landmark[j, 2, 0], landmark[j, 2, 1], landmark[j, 2, 2] = c02, c12, s[_BATCH + 5 * L + i]
            for a in range(3):
                landmark_gradient[j, a] = s[_BATCH + (6 + a) * L + i]


@kernel
def spread_poses(pose: Array, column: Index, stride: int, storage: Array, gradient: Array) -> None:
    """Add the keyframes' accumulators (N, 27) to the stored lower triangle and to the gradient (9N,).

    ``column`` (N,) first stored column of each keyframe; entry (r, c) is ``storage[c * stride + r]``.
    """
    block = np.empty((6, 6))
    for k in range(pose.shape[0]):
        s = pose[k]
        at = 0
        for a in range(3):
            for b in range(a, 3):
                block[b, a] = s[at]
                block[3 + b, 3 + a] = s[15 + at]
                at += 1
        for a in range(3):
            for b in range(3):
                block[3 + a, b] = s[6 + 3 * a + b]
        for b in range(6):
            start = (column[k] + b) * stride + column[k]
            for a in range(b, 6):
                storage[start + a] += block[a, b]
        at = column[k]
        gradient[at] += s[21]
        gradient[at + 1] += s[22]
        gradient[at + 2] += s[23]
        gradient[at + 3] += s[24]
        gradient[at + 4] += s[25]
        gradient[at + 5] += s[26]
