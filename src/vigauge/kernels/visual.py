"""Reprojection errors, and their share of the normal equations, without a Jacobian in memory.

With ray = X - p in W and M = J_l^T J_l, where J_l is the Jacobian of an observation by its
landmark, the Jacobian by the pose is J_l [-I, hat(ray)]. So H needs M only:
landmark block M, coupling [-M; -hat(ray) M], pose block [[M, .], [hat(ray) M, -hat(ray) M hat(ray)]].
The cameras of a keyframe share the ray, so M is summed over them: six numbers a pair of keyframe
and landmark, (00, 01, 02, 11, 12, 22), are all that is kept of its observations.

The sums run over views, a camera at a keyframe each, in blocks of observations: what belongs to the
view stays in registers. A loop that fills one array and no more becomes one of vector instructions,
since the compiler can then tell that what it writes is not what it reads; hence the many short ones.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..so3 import Array
from .compiled import kernel

Index = NDArray[np.int64]
# Numbers that need no test for a sign when they index an array, which vector instructions want.
Unsigned = NDArray[np.uint32]

# Entries of a keyframe's accumulator: M (6), hat(ray) M (9), rotation block (6), both gradients (6).
POSE_ENTRIES = 27

# Scratch for some observations of a view: four vectors of eight at a time.
BLOCK = (17, 32)


@kernel
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
) -> None:
    """Whitened errors into ``out`` (M, 2), from observations in the problem's order."""
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


@kernel
def cost(
    p_W: Array,
    X_W: Array,
    R_CW: Array,
    p_CB: Array,
    intrinsics: Array,
    weight: float,
    run_start: Index,
    run_view: Index,
    obs_landmark: Unsigned,
    uv: Array,
) -> tuple[float, float]:
    """Sum of squares of :func:`residuals`, and of their lengths, from observations in order of runs."""
    n_cameras = R_CW.shape[0]
    squares, lengths = 0.0, 0.0
    for run in range(len(run_view)):
        k, c = run_view[run] // n_cameras, run_view[run] % n_cameras
        px, py, pz = p_W[k, 0], p_W[k, 1], p_W[k, 2]
        R = R_CW[c, k]
        r00, r01, r02 = R[0, 0], R[0, 1], R[0, 2]
        r10, r11, r12 = R[1, 0], R[1, 1], R[1, 2]
        r20, r21, r22 = R[2, 0], R[2, 1], R[2, 2]
        tx, ty, tz = p_CB[c, 0], p_CB[c, 1], p_CB[c, 2]
        fx, fy, cx, cy = intrinsics[c, 0], intrinsics[c, 1], intrinsics[c, 2], intrinsics[c, 3]
        begin, end = run_start[run], run_start[run + 1]
        landmarks, at_u, at_v = obs_landmark[begin:end], uv[0, begin:end], uv[1, begin:end]
        for i in range(len(landmarks)):
            j = landmarks[i]
            x, y, z = X_W[j, 0] - px, X_W[j, 1] - py, X_W[j, 2] - pz
            inverse_depth = 1.0 / (r20 * x + r21 * y + r22 * z + tz)
            u = (r00 * x + r01 * y + r02 * z + tx) * inverse_depth
            v = (r10 * x + r11 * y + r12 * z + ty) * inverse_depth
            r_u = (fx * u + cx - at_u[i]) * weight
            r_v = (fy * v + cy - at_v[i]) * weight
            square = r_u * r_u + r_v * r_v
            squares += square
            lengths += math.sqrt(square)
    return squares, lengths


@kernel
def _view_block(
    begin: int,
    count: int,
    k: int,
    c: int,
    p_W: Array,
    X_W: Array,
    R_CW: Array,
    p_CB: Array,
    intrinsics: Array,
    weight: float,
    obs_landmark: Unsigned,
    uv: Array,
    s: Array,
    pose: Array,
) -> None:
    """M (rows 0-5 of ``s``) and J_l^T r (6-8) of ``count`` observations of a view; their sums to ``pose``.

    The other rows: ray (9-11), residual (12, 13), normalised coordinates (14, 15), w / depth (16). The rows
    of J_l are a = f_x w / depth (R_0 - u R_2), and b alike. Places past the last observation repeat it, and
    then count for nothing.
    """
    size = s.shape[1]
    px, py, pz = p_W[k, 0], p_W[k, 1], p_W[k, 2]
    for i in range(size):
        m = begin + min(i, count - 1)
        j = obs_landmark[m]
        s[9, i] = X_W[j, 0] - px
        s[10, i] = X_W[j, 1] - py
        s[11, i] = X_W[j, 2] - pz
        s[12, i] = uv[0, m]
        s[13, i] = uv[1, m]
    r00, r01, r02 = R_CW[c, k, 0, 0], R_CW[c, k, 0, 1], R_CW[c, k, 0, 2]
    r10, r11, r12 = R_CW[c, k, 1, 0], R_CW[c, k, 1, 1], R_CW[c, k, 1, 2]
    r20, r21, r22 = R_CW[c, k, 2, 0], R_CW[c, k, 2, 1], R_CW[c, k, 2, 2]
    tx, ty, tz = p_CB[c, 0], p_CB[c, 1], p_CB[c, 2]
    fx, fy, cx, cy = intrinsics[c, 0], intrinsics[c, 1], intrinsics[c, 2], intrinsics[c, 3]
    for i in range(size):
        s[16, i] = weight / (r20 * s[9, i] + r21 * s[10, i] + r22 * s[11, i] + tz)
    to_depth = 1.0 / weight
    for i in range(size):
        s[14, i] = (r00 * s[9, i] + r01 * s[10, i] + r02 * s[11, i] + tx) * (s[16, i] * to_depth)
    for i in range(size):
        s[15, i] = (r10 * s[9, i] + r11 * s[10, i] + r12 * s[11, i] + ty) * (s[16, i] * to_depth)
    for i in range(size):
        s[12, i] = (fx * s[14, i] + cx - s[12, i]) * weight
    for i in range(size):
        s[13, i] = (fy * s[15, i] + cy - s[13, i]) * weight
    for i in range(count, size):
        s[16, i] = 0.0
    a0, a1, a2 = fx * r00, fx * r01, fx * r02
    b0, b1, b2 = fy * r10, fy * r11, fy * r12
    ac0, ac1, ac2 = fx * r20, fx * r21, fx * r22
    bc0, bc1, bc2 = fy * r20, fy * r21, fy * r22
    for i in range(size):
        x, y, z = a0 - s[14, i] * ac0, b0 - s[15, i] * bc0, s[16, i]
        s[0, i] = (x * x + y * y) * (z * z)
    for i in range(size):
        x, y = (a0 - s[14, i] * ac0) * (a1 - s[14, i] * ac1), (b0 - s[15, i] * bc0) * (b1 - s[15, i] * bc1)
        s[1, i] = (x + y) * (s[16, i] * s[16, i])
    for i in range(size):
        x, y = (a0 - s[14, i] * ac0) * (a2 - s[14, i] * ac2), (b0 - s[15, i] * bc0) * (b2 - s[15, i] * bc2)
        s[2, i] = (x + y) * (s[16, i] * s[16, i])
    for i in range(size):
        x, y, z = a1 - s[14, i] * ac1, b1 - s[15, i] * bc1, s[16, i]
        s[3, i] = (x * x + y * y) * (z * z)
    for i in range(size):
        x, y = (a1 - s[14, i] * ac1) * (a2 - s[14, i] * ac2), (b1 - s[15, i] * bc1) * (b2 - s[15, i] * bc2)
        s[4, i] = (x + y) * (s[16, i] * s[16, i])
    for i in range(size):
        x, y, z = a2 - s[14, i] * ac2, b2 - s[15, i] * bc2, s[16, i]
        s[5, i] = (x * x + y * y) * (z * z)
    for i in range(size):
        s[6, i] = ((a0 - s[14, i] * ac0) * s[12, i] + (b0 - s[15, i] * bc0) * s[13, i]) * s[16, i]
    for i in range(size):
        s[7, i] = ((a1 - s[14, i] * ac1) * s[12, i] + (b1 - s[15, i] * bc1) * s[13, i]) * s[16, i]
    for i in range(size):
        s[8, i] = ((a2 - s[14, i] * ac2) * s[12, i] + (b2 - s[15, i] * bc2) * s[13, i]) * s[16, i]
    s00, s01, s02, s11, s12, s22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    t00, t01, t02, t10, t11, t12, t20, t21, t22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(size):
        x, y, z = s[9, i], s[10, i], s[11, i]
        m00, m01, m02, m11, m12, m22 = s[0, i], s[1, i], s[2, i], s[3, i], s[4, i], s[5, i]
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
    for i in range(size):
        x, y, z = s[9, i], s[10, i], s[11, i]
        m00, m01, m02, m11, m12, m22 = s[0, i], s[1, i], s[2, i], s[3, i], s[4, i], s[5, i]
        q0, q1, q2 = s[6, i], s[7, i], s[8, i]
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
    weight: float,
    group_landmark: Index,
    order: Index,
    landmark_pair: Index,
    group_run: Index,
    run_start: Index,
    run_view: Index,
    obs_pair: Index,
    obs_landmark: Unsigned,
    uv: Array,
    first_group: int,
    end_group: int,
    information: Array,
    landmark: Array,
    landmark_gradient: Array,
    pose: Array,
    block: Array,
) -> None:
    """Sums over a range of groups: ``information`` (P, 6), landmarks' blocks and gradients, ``pose``.

    The arrays from ``group_landmark`` to ``obs_landmark`` are those of
    :class:`vigauge.structure.Structure`; ``uv`` (2, M) in its order of observations. ``pose``
    (N, 27) takes each keyframe's sums; ``block`` (17, B) is scratch for B observations of a view, and
    comes from outside so that the compiler does not know B and unroll the loops instead.
    """
    n_cameras, size = R_CW.shape[0], block.shape[1]
    most = 0
    for g in range(first_group, end_group):
        most = max(most, landmark_pair[group_landmark[g + 1]] - landmark_pair[group_landmark[g]])
    gradient = np.empty((most, 3))
    for g in range(first_group, end_group):
        base = landmark_pair[group_landmark[g]]
        for run in range(group_run[g], group_run[g + 1]):
            k, c = run_view[run] // n_cameras, run_view[run] % n_cameras
            for begin in range(run_start[run], run_start[run + 1], size):
                count = min(size, run_start[run + 1] - begin)
                _view_block(
                    begin,
                    count,
                    k,
                    c,
                    p_W,
                    X_W,
                    R_CW,
                    p_CB,
                    intrinsics,
                    weight,
                    obs_landmark,
                    uv,
                    block,
                    pose,
                )
                for i in range(count):
                    q = obs_pair[begin + i]
                    if q >= 0:
                        for a in range(6):
                            information[q, a] = block[a, i]
                        for a in range(3):
                            gradient[q - base, a] = block[6 + a, i]
                    else:
                        for a in range(6):
                            information[~q, a] += block[a, i]
                        for a in range(3):
                            gradient[~q - base, a] += block[6 + a, i]
        for place in range(group_landmark[g], group_landmark[g + 1]):
            c00, c01, c02, c11, c12, c22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            h0, h1, h2 = 0.0, 0.0, 0.0
            for q in range(landmark_pair[place], landmark_pair[place + 1]):
                c00 += information[q, 0]
                c01 += information[q, 1]
                c02 += information[q, 2]
                c11 += information[q, 3]
                c12 += information[q, 4]
                c22 += information[q, 5]
                h0 += gradient[q - base, 0]
                h1 += gradient[q - base, 1]
                h2 += gradient[q - base, 2]
            j = order[place]
            landmark[j, 0, 0], landmark[j, 0, 1], landmark[j, 0, 2] = c00, c01, c02
            landmark[j, 1, 0], landmark[j, 1, 1], landmark[j, 1, 2] = c01, c11, c12
            landmark[j, 2, 0], landmark[j, 2, 1], landmark[j, 2, 2] = c02, c12, c22
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
    """Add the keyframes' accumulators (N, 27) to the stored lower triangle and to the gradient (9N,).

    ``column`` (N,) first stored column of each keyframe; entry (r, c) is ``storage[c * stride + r]``.
    ``chain`` J_l(dphi_0), Eq. (9), turns derivatives by the rotation of keyframe 0 into those by dphi_0.
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
        at = column[k]
        gradient[at] += s[21]
        gradient[at + 1] += s[22]
        gradient[at + 2] += s[23]
        gradient[at + 3] += g3
        gradient[at + 4] += g4
        gradient[at + 5] += g5
