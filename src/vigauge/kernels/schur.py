"""Elimination of landmarks: factors of their blocks, couplings, the reduced system, back-substitution.

The coupling of a keyframe at p and a landmark at X is W = -[M; hat(ray) M] with ray = X - p (see
:mod:`.visual`): it is made from the six numbers of M wherever it is needed, which costs less than
to read its eighteen from memory. Pairs stand in the order of groups; what a landmark has one of
stands in the problem's order, so ``order`` gives the landmark of each place among the groups.
"""

from __future__ import annotations

import math

import numpy as np

from ..so3 import Array
from . import blas
from .compiled import kernel
from .visual import Index

# Landmarks whose couplings are multiplied together: few enough for the first-level cache, and, being
# neighbours in the order of groups, seen by nearly the same keyframes.
_AT_ONCE = 32


@kernel
def _factorise(j: int, landmark: Array, damping: Array, gradient: Array, factor: Array, half: Array) -> float:
    """F with F^T F = (C + diag(damping))^-1, lower triangular, and F g; the smallest pivot over its diagonal.

    Not positive where the block has no factor (F is then meaningless), a rounding error where it is singular.
    """
    d0, d1, d2 = (
        landmark[j, 0, 0] + damping[j, 0],
        landmark[j, 1, 1] + damping[j, 1],
        landmark[j, 2, 2] + damping[j, 2],
    )
    l00 = math.sqrt(d0)
    f00 = 1.0 / l00
    l10, l20 = landmark[j, 1, 0] * f00, landmark[j, 2, 0] * f00
    p1 = d1 - l10 * l10
    l11 = math.sqrt(p1)
    f11 = 1.0 / l11
    l21 = (landmark[j, 2, 1] - l20 * l10) * f11
    p2 = d2 - l20 * l20 - l21 * l21
    f22 = 1.0 / math.sqrt(p2)
    f10 = -l10 * f00 * f11
    f21 = -l21 * f11 * f22
    f20 = -(l20 * f00 + l21 * f10) * f22
    factor[j, 0, 0], factor[j, 0, 1], factor[j, 0, 2] = f00, 0.0, 0.0
    factor[j, 1, 0], factor[j, 1, 1], factor[j, 1, 2] = f10, f11, 0.0
    factor[j, 2, 0], factor[j, 2, 1], factor[j, 2, 2] = f20, f21, f22
    g0, g1, g2 = gradient[j, 0], gradient[j, 1], gradient[j, 2]
    half[j, 0] = f00 * g0
    half[j, 1] = f10 * g0 + f11 * g1
    half[j, 2] = f20 * g0 + f21 * g1 + f22 * g2
    # A NaN is no pivot either.
    r1, r2 = p1 / d1, p2 / d2
    return min(r1, r2) if d0 > 0.0 and r1 > 0.0 and r2 > 0.0 else -1.0


@kernel
def _coupling(m: Array, X: Array, p: Array, first: bool, chain: Array, W: Array) -> None:
    """(6, 3) block of (position and rotation, landmark); ``first``: of keyframe 0, see Eq. (9)."""
    x, y, z = X[0] - p[0], X[1] - p[1], X[2] - p[2]
    W[0, 0], W[0, 1], W[0, 2] = -m[0], -m[1], -m[2]
    W[1, 0], W[1, 1], W[1, 2] = -m[1], -m[3], -m[4]
    W[2, 0], W[2, 1], W[2, 2] = -m[2], -m[4], -m[5]
    for b in range(3):
        u, v, w = W[0, b], W[1, b], W[2, b]
        s, t, r = y * w - z * v, z * u - x * w, x * v - y * u
        if first:
            for a in range(3):
                W[3 + a, b] = chain[0, a] * s + chain[1, a] * t + chain[2, a] * r
        else:
            W[3, b], W[4, b], W[5, b] = s, t, r


@kernel
def couplings(
    information: Array,
    p_W: Array,
    X_W: Array,
    chain: Array,
    order: Index,
    landmark_pair: Index,
    pair_keyframe: Index,
    out: Array,
) -> None:
    """Blocks W of all pairs into ``out`` (P, 6, 3), in the order of groups."""
    for place in range(len(order)):
        for q in range(landmark_pair[place], landmark_pair[place + 1]):
            k = pair_keyframe[q]
            _coupling(information[q], X_W[order[place]], p_W[k], k == 0, chain, out[q])


@kernel
def _spread(
    place: int,
    n: int,
    information: Array,
    p_W: Array,
    X_W: Array,
    chain: Array,
    order: Index,
    landmark_pair: Index,
    pair_keyframe: Index,
    pair_row: Index,
    factor: Array,
    half: Array,
    out: Array,
    taken: Array,
) -> None:
    """W F^T of a landmark's pairs into rows 3n.. of ``out`` (., 6 w); W C^-1 g off ``taken`` (6 w,)."""
    j = order[place]
    X, Y, Z = X_W[j, 0], X_W[j, 1], X_W[j, 2]
    f00, f10, f11 = -factor[j, 0, 0], -factor[j, 1, 0], -factor[j, 1, 1]
    f20, f21, f22 = -factor[j, 2, 0], -factor[j, 2, 1], -factor[j, 2, 2]
    h0, h1, h2 = half[j, 0], half[j, 1], half[j, 2]
    for q in range(landmark_pair[place], landmark_pair[place + 1]):
        k, at = pair_keyframe[q], 6 * pair_row[q]
        x, y, z = X - p_W[k, 0], Y - p_W[k, 1], Z - p_W[k, 2]
        m0, m1, m2 = information[q, 0], information[q, 1], information[q, 2]
        m3, m4, m5 = information[q, 3], information[q, 4], information[q, 5]
        u00, u10, u20 = m0 * f00, m1 * f00, m2 * f00
        u01, u11, u21 = m0 * f10 + m1 * f11, m1 * f10 + m3 * f11, m2 * f10 + m4 * f11
        u02 = m0 * f20 + m1 * f21 + m2 * f22
        u12 = m1 * f20 + m3 * f21 + m4 * f22
        u22 = m2 * f20 + m4 * f21 + m5 * f22
        a0, a1, a2 = y * u20 - z * u10, z * u00 - x * u20, x * u10 - y * u00
        b0, b1, b2 = y * u21 - z * u11, z * u01 - x * u21, x * u11 - y * u01
        c0, c1, c2 = y * u22 - z * u12, z * u02 - x * u22, x * u12 - y * u02
        if k == 0:
            a0, a1, a2 = (
                chain[0, 0] * a0 + chain[1, 0] * a1 + chain[2, 0] * a2,
                chain[0, 1] * a0 + chain[1, 1] * a1 + chain[2, 1] * a2,
                chain[0, 2] * a0 + chain[1, 2] * a1 + chain[2, 2] * a2,
            )
            b0, b1, b2 = (
                chain[0, 0] * b0 + chain[1, 0] * b1 + chain[2, 0] * b2,
                chain[0, 1] * b0 + chain[1, 1] * b1 + chain[2, 1] * b2,
                chain[0, 2] * b0 + chain[1, 2] * b1 + chain[2, 2] * b2,
            )
            c0, c1, c2 = (
                chain[0, 0] * c0 + chain[1, 0] * c1 + chain[2, 0] * c2,
                chain[0, 1] * c0 + chain[1, 1] * c1 + chain[2, 1] * c2,
                chain[0, 2] * c0 + chain[1, 2] * c1 + chain[2, 2] * c2,
            )
        out[3 * n, at], out[3 * n, at + 1], out[3 * n, at + 2] = u00, u10, u20
        out[3 * n, at + 3], out[3 * n, at + 4], out[3 * n, at + 5] = a0, a1, a2
        out[3 * n + 1, at], out[3 * n + 1, at + 1], out[3 * n + 1, at + 2] = u01, u11, u21
        out[3 * n + 1, at + 3], out[3 * n + 1, at + 4], out[3 * n + 1, at + 5] = b0, b1, b2
        out[3 * n + 2, at], out[3 * n + 2, at + 1], out[3 * n + 2, at + 2] = u02, u12, u22
        out[3 * n + 2, at + 3], out[3 * n + 2, at + 4], out[3 * n + 2, at + 5] = c0, c1, c2
        taken[at] -= u00 * h0 + u01 * h1 + u02 * h2
        taken[at + 1] -= u10 * h0 + u11 * h1 + u12 * h2
        taken[at + 2] -= u20 * h0 + u21 * h1 + u22 * h2
        taken[at + 3] -= a0 * h0 + b0 * h1 + c0 * h2
        taken[at + 4] -= a1 * h0 + b1 * h1 + c1 * h2
        taken[at + 5] -= a2 * h0 + b2 * h1 + c2 * h2


@kernel
def _scatter(
    product: Array,
    taken: Array,
    keyframes: Index,
    column: Index,
    stride: int,
    base: int,
    storage: Array,
    gradient: Array,
) -> None:
    """Subtract a group's product (6 w, 6 w) from the stored triangle; add its ``taken`` to the gradient.

    Of ``product`` the entries with column >= row are filled.
    """
    for i in range(len(keyframes)):
        left = column[keyframes[i]]
        for a in range(6):
            gradient[left + a] += taken[6 * i + a]
            start = (left + a) * stride + left - base
            for b in range(a, 6):
                storage[start + b] -= product[6 * i + a, 6 * i + b]
        for j in range(i + 1, len(keyframes)):
            right = column[keyframes[j]]
            if right > left:
                for a in range(6):
                    start = (left + a) * stride + right - base
                    for b in range(6):
                        storage[start + b] -= product[6 * i + a, 6 * j + b]
            else:
                for b in range(6):
                    start = (right + b) * stride + left - base
                    for a in range(6):
                        storage[start + a] -= product[6 * i + a, 6 * j + b]


@kernel
def eliminate(
    information: Array,
    p_W: Array,
    X_W: Array,
    chain: Array,
    landmark: Array,
    damping: Array,
    landmark_gradient: Array,
    group_landmark: Index,
    order: Index,
    landmark_pair: Index,
    pair_keyframe: Index,
    pair_row: Index,
    group_seen: Index,
    seen: Index,
    column: Index,
    stride: int,
    base: int,
    first_group: int,
    end_group: int,
    factor: Array,
    half_gradient: Array,
    storage: Array,
    gradient: Array,
) -> float:
    """Take the landmarks of a range of groups out of the motion block and its gradient (9N,).

    ``damping`` (K, 3) is added to the diagonals of ``landmark`` (K, 3, 3). Fills ``factor``
    (K, 3, 3) and ``half_gradient`` (K, 3), see :func:`_factorise`, and returns the smallest pivot.
    Entry (r, c) of the stored lower triangle is ``storage[c * stride + r - base]``.
    """
    widest = 0
    for g in range(first_group, end_group):
        widest = max(widest, 6 * (group_seen[g + 1] - group_seen[g]))
    spread, square, taken = np.empty(3 * _AT_ONCE * widest), np.empty(widest * widest), np.empty(widest)
    smallest = 1.0
    for g in range(first_group, end_group):
        width = 6 * (group_seen[g + 1] - group_seen[g])
        product = square[: width * width].reshape(width, width)
        product[:] = 0.0
        taken[:] = 0.0
        for begin in range(group_landmark[g], group_landmark[g + 1], _AT_ONCE):
            end = min(begin + _AT_ONCE, group_landmark[g + 1])
            low, high = width, 0
            for q in range(landmark_pair[begin], landmark_pair[end]):
                low, high = min(low, 6 * pair_row[q]), max(high, 6 * pair_row[q] + 6)
            out = spread[: 3 * (end - begin) * width].reshape(3 * (end - begin), width)
            for a in range(len(out)):
                out[a, low:high] = 0.0
            for place in range(begin, end):
                pivot = _factorise(order[place], landmark, damping, landmark_gradient, factor, half_gradient)
                smallest = min(smallest, pivot)
                _spread(
                    place,
                    place - begin,
                    information,
                    p_W,
                    X_W,
                    chain,
                    order,
                    landmark_pair,
                    pair_keyframe,
                    pair_row,
                    factor,
                    half_gradient,
                    out,
                    taken,
                )
            blas.add_gram(out, low, high, product)
        _scatter(
            product, taken, seen[group_seen[g] : group_seen[g + 1]], column, stride, base, storage, gradient
        )
    return smallest


@kernel
def back_substitute(
    information: Array,
    p_W: Array,
    X_W: Array,
    chain: Array,
    factor: Array,
    half_gradient: Array,
    order: Index,
    landmark_pair: Index,
    pair_keyframe: Index,
    column: Index,
    motion: Array,
    out: Array,
) -> None:
    """Landmark steps -F^T (F g + F W^T x) into ``out`` (K, 3), for the motion step x (9N,) in stored order.

    W^T (x_p, x_r) = -M (x_p - ray x x_r), and ray = X - p: what the keyframe gives is added up once.
    """
    frame = np.empty((len(p_W), 6))
    for k in range(len(p_W)):
        at = column[k]
        r0, r1, r2 = motion[at + 3], motion[at + 4], motion[at + 5]
        if k == 0:
            r0, r1, r2 = (
                chain[0, 0] * r0 + chain[0, 1] * r1 + chain[0, 2] * r2,
                chain[1, 0] * r0 + chain[1, 1] * r1 + chain[1, 2] * r2,
                chain[2, 0] * r0 + chain[2, 1] * r1 + chain[2, 2] * r2,
            )
        x, y, z = p_W[k, 0], p_W[k, 1], p_W[k, 2]
        frame[k, 0] = motion[at] + y * r2 - z * r1
        frame[k, 1] = motion[at + 1] + z * r0 - x * r2
        frame[k, 2] = motion[at + 2] + x * r1 - y * r0
        frame[k, 3], frame[k, 4], frame[k, 5] = r0, r1, r2
    for place in range(len(order)):
        j = order[place]
        x, y, z = X_W[j, 0], X_W[j, 1], X_W[j, 2]
        t0, t1, t2 = 0.0, 0.0, 0.0
        for q in range(landmark_pair[place], landmark_pair[place + 1]):
            k = pair_keyframe[q]
            r0, r1, r2 = frame[k, 3], frame[k, 4], frame[k, 5]
            y0 = frame[k, 0] - y * r2 + z * r1
            y1 = frame[k, 1] - z * r0 + x * r2
            y2 = frame[k, 2] - x * r1 + y * r0
            m1, m2, m4 = information[q, 1], information[q, 2], information[q, 4]
            t0 -= information[q, 0] * y0 + m1 * y1 + m2 * y2
            t1 -= m1 * y0 + information[q, 3] * y1 + m4 * y2
            t2 -= m2 * y0 + m4 * y1 + information[q, 5] * y2
        f00, f10, f11 = factor[j, 0, 0], factor[j, 1, 0], factor[j, 1, 1]
        f20, f21, f22 = factor[j, 2, 0], factor[j, 2, 1], factor[j, 2, 2]
        r0 = -half_gradient[j, 0] - f00 * t0
        r1 = -half_gradient[j, 1] - f10 * t0 - f11 * t1
        r2 = -half_gradient[j, 2] - f20 * t0 - f21 * t1 - f22 * t2
        out[j, 0] = f00 * r0 + f10 * r1 + f20 * r2
        out[j, 1] = f11 * r1 + f21 * r2
        out[j, 2] = f22 * r2


@kernel
def couple(
    information: Array,
    p_W: Array,
    X_W: Array,
    chain: Array,
    factor: Array,
    order: Index,
    landmark_pair: Index,
    pair_keyframe: Index,
    landmark: Array,
    out: Array,
    gram: Array,
) -> None:
    """W C^-1 V of landmark columns V (K, 3, 4), V^T C^-1 V: zeroed ``out`` (N, 9, 4) and ``gram`` (4, 4).

    Four columns, the degrees of freedom of the gauge: a fixed number fits a vector register.
    """
    half, through = np.empty((3, 4)), np.empty((3, 4))
    for place in range(len(order)):
        j = order[place]
        X, Y, Z = X_W[j, 0], X_W[j, 1], X_W[j, 2]
        f00, f10, f11 = factor[j, 0, 0], factor[j, 1, 0], factor[j, 1, 1]
        f20, f21, f22 = factor[j, 2, 0], factor[j, 2, 1], factor[j, 2, 2]
        for c in range(4):
            half[0, c] = f00 * landmark[j, 0, c]
            half[1, c] = f10 * landmark[j, 0, c] + f11 * landmark[j, 1, c]
            half[2, c] = f20 * landmark[j, 0, c] + f21 * landmark[j, 1, c] + f22 * landmark[j, 2, c]
            through[0, c] = f00 * half[0, c] + f10 * half[1, c] + f20 * half[2, c]
            through[1, c] = f11 * half[1, c] + f21 * half[2, c]
            through[2, c] = f22 * half[2, c]
        for b in range(4):
            for c in range(4):
                gram[b, c] += half[0, b] * half[0, c] + half[1, b] * half[1, c] + half[2, b] * half[2, c]
        for q in range(landmark_pair[place], landmark_pair[place + 1]):
            k = pair_keyframe[q]
            x, y, z = X - p_W[k, 0], Y - p_W[k, 1], Z - p_W[k, 2]
            m0, m1, m2 = information[q, 0], information[q, 1], information[q, 2]
            m3, m4, m5 = information[q, 3], information[q, 4], information[q, 5]
            for c in range(4):
                u = -m0 * through[0, c] - m1 * through[1, c] - m2 * through[2, c]
                v = -m1 * through[0, c] - m3 * through[1, c] - m4 * through[2, c]
                w = -m2 * through[0, c] - m4 * through[1, c] - m5 * through[2, c]
                out[k, 0, c] += u
                out[k, 1, c] += v
                out[k, 2, c] += w
                out[k, 3, c] += y * w - z * v
                out[k, 4, c] += z * u - x * w
                out[k, 5, c] += x * v - y * u
    # Keyframe 0 by its total increment, Eq. (9).
    for c in range(4):
        u, v, w = out[0, 3, c], out[0, 4, c], out[0, 5, c]
        for a in range(3):
            out[0, 3 + a, c] = chain[0, a] * u + chain[1, a] * v + chain[2, a] * w
