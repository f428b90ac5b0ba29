"""Reprojection errors, and their share of the normal equations, without a Jacobian in memory.

With ray = X - p in W and M = J_l^T J_l, where J_l is the Jacobian of an observation by its
landmark, the Jacobian by the pose is J_l [-I, hat(ray)]. So H needs M only:
landmark block M, coupling [-M; -hat(ray) M], pose block [[M, .], [hat(ray) M, -hat(ray) M hat(ray)]].
The cameras of a keyframe share the ray, so M is summed over them first.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..so3 import Array
from .compiled import kernel

Index = NDArray[np.int64]

# Entries of a keyframe's accumulator: M (6), hat(ray) M (9), rotation block (6), both gradients (6).
POSE_ENTRIES = 27


@kernel
def camera_rotations(R_WB: Array, R_BC: Array, p_BC: Array, R_CW: Array, p_CB: Array) -> None:
    """R_CW (C, N, 3, 3) and the body's origin in each camera (C, 3)."""
    for c in range(R_BC.shape[0]):
        for a in range(3):
            p_CB[c, a] = -(
                R_BC[c, 0, a] * p_BC[c, 0] + R_BC[c, 1, a] * p_BC[c, 1] + R_BC[c, 2, a] * p_BC[c, 2]
            )
        for i in range(R_WB.shape[0]):
            for a in range(3):
                for b in range(3):
                    R_CW[c, i, a, b] = (
                        R_BC[c, 0, a] * R_WB[i, b, 0]
                        + R_BC[c, 1, a] * R_WB[i, b, 1]
                        + R_BC[c, 2, a] * R_WB[i, b, 2]
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
    weight: float,
    out: Array,
) -> tuple[float, float]:
    """Whitened errors into ``out`` (M, 2); their sum of squares, and the sum of their lengths."""
    squares, lengths = 0.0, 0.0
    for m in range(uv.shape[0]):
        k, c, j = keyframe[m], camera[m], landmark[m]
        x, y, z = X_W[j, 0] - p_W[k, 0], X_W[j, 1] - p_W[k, 1], X_W[j, 2] - p_W[k, 2]
        R = R_CW[c, k]
        inverse_depth = 1.0 / (R[2, 0] * x + R[2, 1] * y + R[2, 2] * z + p_CB[c, 2])
        u = (R[0, 0] * x + R[0, 1] * y + R[0, 2] * z + p_CB[c, 0]) * inverse_depth
        v = (R[1, 0] * x + R[1, 1] * y + R[1, 2] * z + p_CB[c, 1]) * inverse_depth
        r_u = (intrinsics[c, 0] * u + intrinsics[c, 2] - uv[m, 0]) * weight
        r_v = (intrinsics[c, 1] * v + intrinsics[c, 3] - uv[m, 1]) * weight
        out[m, 0], out[m, 1] = r_u, r_v
        square = r_u * r_u + r_v * r_v
        squares += square
        lengths += math.sqrt(square)
    return squares, lengths


@kernel
def accumulate(
    p_W: Array,
    X_W: Array,
    R_CW: Array,
    p_CB: Array,
    intrinsics: Array,
    camera: Index,
    uv: Array,
    weight: float,
    chain: Array,
    pair_start: Index,
    pair_keyframe: Index,
    landmark_pair: Index,
    begin: int,
    end: int,
    pair: Array,
    landmark: Array,
    landmark_gradient: Array,
    pose: Array,
) -> None:
    """Blocks of the landmarks begin..end: fills ``pair``, ``landmark`` and its gradient, adds to ``pose``.

    ``pair_start`` (P + 1,) observations of each pair, ``landmark_pair`` (K + 1,) pairs of each
    landmark; ``chain`` J_l(dphi_0), Eq. (9), applied to the couplings of keyframe 0 (the
    caller applies it to that keyframe's ``pose`` (N, 27), which is summed untransformed).
    """
    for j in range(begin, end):
        c00, c01, c02, c11, c12, c22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        h0, h1, h2 = 0.0, 0.0, 0.0
        for q in range(landmark_pair[j], landmark_pair[j + 1]):
            k = pair_keyframe[q]
            x, y, z = X_W[j, 0] - p_W[k, 0], X_W[j, 1] - p_W[k, 1], X_W[j, 2] - p_W[k, 2]
            m00, m01, m02, m11, m12, m22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            g0, g1, g2 = 0.0, 0.0, 0.0
            for m in range(pair_start[q], pair_start[q + 1]):
                c = camera[m]
                R = R_CW[c, k]
                inverse_depth = 1.0 / (R[2, 0] * x + R[2, 1] * y + R[2, 2] * z + p_CB[c, 2])
                u = (R[0, 0] * x + R[0, 1] * y + R[0, 2] * z + p_CB[c, 0]) * inverse_depth
                v = (R[1, 0] * x + R[1, 1] * y + R[1, 2] * z + p_CB[c, 1]) * inverse_depth
                r_u = (intrinsics[c, 0] * u + intrinsics[c, 2] - uv[m, 0]) * weight
                r_v = (intrinsics[c, 1] * v + intrinsics[c, 3] - uv[m, 1]) * weight
                s_u = intrinsics[c, 0] * inverse_depth * weight
                s_v = intrinsics[c, 1] * inverse_depth * weight
                a0, a1, a2 = (
                    s_u * (R[0, 0] - u * R[2, 0]),
                    s_u * (R[0, 1] - u * R[2, 1]),
                    s_u * (R[0, 2] - u * R[2, 2]),
                )
                b0, b1, b2 = (
                    s_v * (R[1, 0] - v * R[2, 0]),
                    s_v * (R[1, 1] - v * R[2, 1]),
                    s_v * (R[1, 2] - v * R[2, 2]),
                )
                m00 += a0 * a0 + b0 * b0
                m01 += a0 * a1 + b0 * b1
                m02 += a0 * a2 + b0 * b2
                m11 += a1 * a1 + b1 * b1
                m12 += a1 * a2 + b1 * b2
                m22 += a2 * a2 + b2 * b2
                g0 += a0 * r_u + b0 * r_v
                g1 += a1 * r_u + b1 * r_v
                g2 += a2 * r_u + b2 * r_v
            c00 += m00
            c01 += m01
            c02 += m02
            c11 += m11
            c12 += m12
            c22 += m22
            h0 += g0
            h1 += g1
            h2 += g2
            # hat(ray) M, row by row
            t00, t01, t02 = y * m02 - z * m01, y * m12 - z * m11, y * m22 - z * m12
            t10, t11, t12 = z * m00 - x * m02, z * m01 - x * m12, z * m02 - x * m22
            t20, t21, t22 = x * m01 - y * m00, x * m11 - y * m01, x * m12 - y * m02
            w = pair[q]
            w[0, 0], w[0, 1], w[0, 2] = -m00, -m01, -m02
            w[1, 0], w[1, 1], w[1, 2] = -m01, -m11, -m12
            w[2, 0], w[2, 1], w[2, 2] = -m02, -m12, -m22
            if k == 0:
                for a in range(3):
                    w[3 + a, 0] = -(chain[0, a] * t00 + chain[1, a] * t10 + chain[2, a] * t20)
                    w[3 + a, 1] = -(chain[0, a] * t01 + chain[1, a] * t11 + chain[2, a] * t21)
                    w[3 + a, 2] = -(chain[0, a] * t02 + chain[1, a] * t12 + chain[2, a] * t22)
            else:
                w[3, 0], w[3, 1], w[3, 2] = -t00, -t01, -t02
                w[4, 0], w[4, 1], w[4, 2] = -t10, -t11, -t12
                w[5, 0], w[5, 1], w[5, 2] = -t20, -t21, -t22
            s = pose[k]
            s[0] += m00
            s[1] += m01
            s[2] += m02
            s[3] += m11
            s[4] += m12
            s[5] += m22
            s[6] += t00
            s[7] += t01
            s[8] += t02
            s[9] += t10
            s[10] += t11
            s[11] += t12
            s[12] += t20
            s[13] += t21
            s[14] += t22
            # -hat(ray) M hat(ray) = -(T hat(ray)), symmetric
            s[15] += -(t01 * z - t02 * y)
            s[16] += -(t02 * x - t00 * z)
            s[17] += -(t00 * y - t01 * x)
            s[18] += -(t12 * x - t10 * z)
            s[19] += -(t10 * y - t11 * x)
            s[20] += -(t20 * y - t21 * x)
            s[21] -= g0
            s[22] -= g1
            s[23] -= g2
            s[24] += g1 * z - g2 * y
            s[25] += g2 * x - g0 * z
            s[26] += g0 * y - g1 * x
        n = landmark[j]
        n[0, 0], n[0, 1], n[0, 2] = c00, c01, c02
        n[1, 0], n[1, 1], n[1, 2] = c01, c11, c12
        n[2, 0], n[2, 1], n[2, 2] = c02, c12, c22
        landmark_gradient[j, 0], landmark_gradient[j, 1], landmark_gradient[j, 2] = h0, h1, h2


@kernel
def left_multiply_transposed(A: Array, B: Array) -> None:
    """B <- A^T B for 3 x 3 matrices, in place."""
    for b in range(B.shape[1]):
        x, y, z = B[0, b], B[1, b], B[2, b]
        for a in range(3):
            B[a, b] = A[0, a] * x + A[1, a] * y + A[2, a] * z


@kernel
def spread_poses(
    pose: Array, chain: Array, column: Index, stride: int, storage: Array, gradient: Array
) -> None:
    """Add the keyframes' accumulators (N, 27) to the stored lower triangle and to the motion gradient (N, 9).

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
        g3, g4, g5 = s[24], s[25], s[26]
        if k == 0:
            block[3, 4], block[3, 5], block[4, 5] = block[4, 3], block[5, 3], block[5, 4]
            left_multiply_transposed(chain, block[3:, :3])
            left_multiply_transposed(chain, block[3:, 3:])
            left_multiply_transposed(chain, block[3:, 3:].T)
            g3 = chain[0, 0] * s[24] + chain[1, 0] * s[25] + chain[2, 0] * s[26]
            g4 = chain[0, 1] * s[24] + chain[1, 1] * s[25] + chain[2, 1] * s[26]
            g5 = chain[0, 2] * s[24] + chain[1, 2] * s[25] + chain[2, 2] * s[26]
        for b in range(6):
            start = (column[k] + b) * stride + column[k]
            for a in range(b, 6):
                storage[start + a] += block[a, b]
        gradient[k, 0] += s[21]
        gradient[k, 1] += s[22]
        gradient[k, 2] += s[23]
        gradient[k, 3] += g3
        gradient[k, 4] += g4
        gradient[k, 5] += g5
