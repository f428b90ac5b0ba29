"""Elimination of landmarks: factors of their blocks, couplings spread for one product, back-substitution."""

from __future__ import annotations

import math

import numpy as np

from ..so3 import Array
from .compiled import kernel
from .visual import Index


@kernel
def factorise(landmark: Array, damping: Array, gradient: Array, factor: Array, half_gradient: Array) -> float:
    """F with F^T F = (C + diag(damping))^-1, lower triangular, and F g.

    Returns the smallest pivot over its diagonal entry: not positive where a block has no
    factor (its F is then meaningless), a rounding error where one is singular.
    """
    smallest = 1.0
    for k in range(landmark.shape[0]):
        c = landmark[k]
        d0, d1, d2 = c[0, 0] + damping[k, 0], c[1, 1] + damping[k, 1], c[2, 2] + damping[k, 2]
        l00 = math.sqrt(d0)
        l10, l20 = c[1, 0] / l00, c[2, 0] / l00
        p1 = d1 - l10 * l10
        l11 = math.sqrt(p1)
        l21 = (c[2, 1] - l20 * l10) / l11
        p2 = d2 - l20 * l20 - l21 * l21
        l22 = math.sqrt(p2)
        ratio = min(p1 / d1, p2 / d2)
        # A NaN is no pivot either.
        if not (d0 > 0.0 and p1 > 0.0 and p2 > 0.0):
            ratio = -1.0
        smallest = min(smallest, ratio)
        f00, f11, f22 = 1.0 / l00, 1.0 / l11, 1.0 / l22
        f10 = -l10 * f00 * f11
        f21 = -l21 * f11 * f22
        f20 = -(l20 * f00 + l21 * f10) * f22
        f = factor[k]
        f[0, 0], f[0, 1], f[0, 2] = f00, 0.0, 0.0
        f[1, 0], f[1, 1], f[1, 2] = f10, f11, 0.0
        f[2, 0], f[2, 1], f[2, 2] = f20, f21, f22
        g = gradient[k]
        half_gradient[k, 0] = f00 * g[0]
        half_gradient[k, 1] = f10 * g[0] + f11 * g[1]
        half_gradient[k, 2] = f20 * g[0] + f21 * g[1] + f22 * g[2]
    return smallest


@kernel
def spread(
    pair: Array,
    factor: Array,
    half_gradient: Array,
    members: Index,
    landmark_pair: Index,
    pair_row: Index,
    out: Array,
    gradient: Array,
) -> None:
    """Couplings W F^T of a group's landmarks into ``out`` (3 L, 6 w); W C^-1 g off ``gradient`` (w, 6).

    ``members`` (L,) landmarks; ``pair_row`` (P,) place of each pair's keyframe in the group.
    """
    out[:] = 0.0
    for n in range(len(members)):
        j = members[n]
        f, h = factor[j], half_gradient[j]
        f00, f10, f11, f20, f21, f22 = f[0, 0], f[1, 0], f[1, 1], f[2, 0], f[2, 1], f[2, 2]
        h0, h1, h2 = h[0], h[1], h[2]
        for q in range(landmark_pair[j], landmark_pair[j + 1]):
            row = pair_row[q]
            w = pair[q]
            for a in range(6):
                u0 = w[a, 0] * f00
                u1 = w[a, 0] * f10 + w[a, 1] * f11
                u2 = w[a, 0] * f20 + w[a, 1] * f21 + w[a, 2] * f22
                out[3 * n, 6 * row + a] = u0
                out[3 * n + 1, 6 * row + a] = u1
                out[3 * n + 2, 6 * row + a] = u2
                gradient[row, a] -= u0 * h0 + u1 * h1 + u2 * h2


@kernel
def scatter(
    product: Array, gradient: Array, keyframes: Index, column: Index, stride: int, storage: Array, out: Array
) -> None:
    """Subtract a group's product (6 w, 6 w) from the stored triangle; add its gradient to ``out`` (N, 9).

    Of ``product`` the entries with row >= column are filled.
    """
    for i in range(len(keyframes)):
        left = column[keyframes[i]]
        for a in range(6):
            out[keyframes[i], a] += gradient[i, a]
            start = (left + a) * stride
            for b in range(a, 6):
                storage[start + left + b] -= product[6 * i + b, 6 * i + a]
        for j in range(i + 1, len(keyframes)):
            right = column[keyframes[j]]
            for a in range(6):
                for b in range(6):
                    value = product[6 * j + b, 6 * i + a]
                    if right > left:
                        storage[(left + a) * stride + right + b] -= value
                    else:
                        storage[(right + b) * stride + left + a] -= value


@kernel
def back_substitute(
    pair: Array,
    factor: Array,
    half_gradient: Array,
    landmark_pair: Index,
    pair_keyframe: Index,
    motion: Array,
    out: Array,
) -> None:
    """Landmark steps -F^T (F g + F W^T x) that go with the motion step x (N, 9), into ``out`` (K, 3)."""
    for j in range(factor.shape[0]):
        t0, t1, t2 = 0.0, 0.0, 0.0
        for q in range(landmark_pair[j], landmark_pair[j + 1]):
            w, x = pair[q], motion[pair_keyframe[q]]
            for a in range(6):
                t0 += w[a, 0] * x[a]
                t1 += w[a, 1] * x[a]
                t2 += w[a, 2] * x[a]
        f = factor[j]
        r0 = -half_gradient[j, 0] - f[0, 0] * t0
        r1 = -half_gradient[j, 1] - f[1, 0] * t0 - f[1, 1] * t1
        r2 = -half_gradient[j, 2] - f[2, 0] * t0 - f[2, 1] * t1 - f[2, 2] * t2
        out[j, 0] = f[0, 0] * r0 + f[1, 0] * r1 + f[2, 0] * r2
        out[j, 1] = f[1, 1] * r1 + f[2, 1] * r2
        out[j, 2] = f[2, 2] * r2


@kernel
def couple(
    pair: Array,
    factor: Array,
    landmark_pair: Index,
    pair_keyframe: Index,
    landmark: Array,
    out: Array,
    gram: Array,
) -> None:
    """Add W C^-1 V of landmark columns V (K, 3, 4) to ``out`` (N, 9, 4), V^T C^-1 V to ``gram`` (4, 4).

    Four columns, the degrees of freedom of the gauge: a fixed number fits a vector register.
    """
    half, through = np.empty((3, 4)), np.empty((3, 4))
    for j in range(factor.shape[0]):
        f, v = factor[j], landmark[j]
        for c in range(4):
            half[0, c] = f[0, 0] * v[0, c]
            half[1, c] = f[1, 0] * v[0, c] + f[1, 1] * v[1, c]
            half[2, c] = f[2, 0] * v[0, c] + f[2, 1] * v[1, c] + f[2, 2] * v[2, c]
            through[0, c] = f[0, 0] * half[0, c] + f[1, 0] * half[1, c] + f[2, 0] * half[2, c]
            through[1, c] = f[1, 1] * half[1, c] + f[2, 1] * half[2, c]
            through[2, c] = f[2, 2] * half[2, c]
        for b in range(4):
            for c in range(4):
                gram[b, c] += half[0, b] * half[0, c] + half[1, b] * half[1, c] + half[2, b] * half[2, c]
        x0, x1, x2, x3 = through[0, 0], through[0, 1], through[0, 2], through[0, 3]
        y0, y1, y2, y3 = through[1, 0], through[1, 1], through[1, 2], through[1, 3]
        z0, z1, z2, z3 = through[2, 0], through[2, 1], through[2, 2], through[2, 3]
        for q in range(landmark_pair[j], landmark_pair[j + 1]):
            k = pair_keyframe[q]
            for a in range(6):
                w0, w1, w2 = pair[q, a, 0], pair[q, a, 1], pair[q, a, 2]
                out[k, a, 0] += w0 * x0 + w1 * y0 + w2 * z0
                out[k, a, 1] += w0 * x1 + w1 * y1 + w2 * z1
                out[k, a, 2] += w0 * x2 + w1 * y2 + w2 * z2
                out[k, a, 3] += w0 * x3 + w1 * y3 + w2 * z3
