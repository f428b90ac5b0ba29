"""Elimination of landmarks: factors of their blocks, the reduced system, back-substitution.

The coupling of a keyframe at p and a landmark at X is W = -[M; hat(ray) M] with ray = X - p (see
:mod:`.visual`): it is made from the six numbers of M wherever it is needed, which costs less than
to read its eighteen from memory. Loops run over cells, see :mod:`.lanes`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..geometry.so3 import Array
from . import blas
from .compiled import kernel, part
from .covisibility import LONG_GAPS
from .lanes import LANES as L
from .lanes import Batches, Index, gather_points
from .sizes import GAUGE
from .transposition import store_by_lanes


class Couplings(NamedTuple):
    """What the couplings W are made from.

    ``information`` (Q, 6 L) upper triangle of M of every cell; ``p_W`` (N, 3) and ``X_W`` (K, 3)
    positions, m.
    """

    information: Array
    p_W: Array
    X_W: Array


# Rows of scratch: X (3), M (6); the batch's C (6), damping (3), g (3), F (6), F g (3), scaled
# determinant (1); W F^T (18).
_M, _C, _F, _HALF, _REGULAR, _W, _ROWS = 3 * L, 9 * L, 21 * L, 27 * L, 30 * L, 31 * L, 49


@part
def _load_cell(cell: int, information: Array, s: Array) -> None:
    for i in range(information.shape[1]):
        s[_M + i] = information[cell, i]


@part
def _load_factor(b: int, factor: Array, s: Array) -> None:
    for i in range(factor.shape[1]):
        s[_F + i] = factor[b, i]


@part
def _factorise(
    first: int,
    last: int,
    order: Index,
    landmark: Array,
    damping: Array,
    motion: int,
    gradient: Array,
    lanes: int,
    s: Array,
) -> float:
    """F with F^T F = (C + diag(damping))^-1, lower triangular, and F g; the smallest determinant of a block
    over that of its diagonal.

    Not positive where a block has no factor (F is then meaningless), a rounding error where it is singular.
    """
    damped = len(damping) > 0
    for i in range(lanes):
        j = order[min(first + i, last)]
        s[_C + i], s[_C + L + i], s[_C + 2 * L + i] = landmark[j, 0, 0], landmark[j, 1, 0], landmark[j, 2, 0]
        s[_C + 3 * L + i], s[_C + 4 * L + i] = landmark[j, 1, 1], landmark[j, 2, 1]
        s[_C + 5 * L + i] = landmark[j, 2, 2]
        for a in range(3):
            s[_C + (6 + a) * L + i] = damping[motion + 3 * j + a] if damped else 0.0
            s[_C + (9 + a) * L + i] = gradient[j, a]
    for i in range(lanes):
        d0 = s[_C + i] + s[_C + 6 * L + i]
        d1 = s[_C + 3 * L + i] + s[_C + 7 * L + i]
        d2 = s[_C + 5 * L + i] + s[_C + 8 * L + i]
        f00 = 1.0 / math.sqrt(d0)
        l10, l20 = s[_C + L + i] * f00, s[_C + 2 * L + i] * f00
        p1 = d1 - l10 * l10
        f11 = 1.0 / math.sqrt(p1)
        l21 = (s[_C + 4 * L + i] - l20 * l10) * f11
        p2 = d2 - l20 * l20 - l21 * l21
        f22 = 1.0 / math.sqrt(p2)
        f10 = -l10 * f00 * f11
        f21 = -l21 * f11 * f22
        f20 = -(l20 * f00 + l21 * f10) * f22
        g0, g1, g2 = s[_C + 9 * L + i], s[_C + 10 * L + i], s[_C + 11 * L + i]
        s[_F + i], s[_F + L + i], s[_F + 2 * L + i] = f00, f10, f20
        s[_F + 3 * L + i], s[_F + 4 * L + i], s[_F + 5 * L + i] = f11, f21, f22
        s[_HALF + i] = f00 * g0
        s[_HALF + L + i] = f10 * g0 + f11 * g1
        s[_HALF + 2 * L + i] = f20 * g0 + f21 * g1 + f22 * g2
        # A NaN is no pivot either.
        positive = d0 > 0.0 and p1 > 0.0 and p2 > 0.0
        s[_REGULAR + i] = (p1 / d1) * (p2 / d2) if positive else -1.0
    smallest = 1.0
    for i in range(lanes):
        smallest = min(smallest, s[_REGULAR + i])
    return smallest


@part
def _spread(
    cell: int,
    k: int,
    at: int,
    information: Array,
    p_W: Array,
    lanes: int,
    s: Array,
    out: Array,
    columns: int,
    taken: Array,
) -> None:
    """W F^T of a cell into columns ``at``.. of ``out``, three rows a landmark; W C^-1 g off ``taken``."""
    px, py, pz = p_W[k, 0], p_W[k, 1], p_W[k, 2]
    _load_cell(cell, information, s)
    for i in range(lanes):
        x, y, z = s[i] - px, s[L + i] - py, s[2 * L + i] - pz
        f00, f10, f20 = -s[_F + i], -s[_F + L + i], -s[_F + 2 * L + i]
        f11, f21, f22 = -s[_F + 3 * L + i], -s[_F + 4 * L + i], -s[_F + 5 * L + i]
        m0, m1, m2 = s[_M + i], s[_M + L + i], s[_M + 2 * L + i]
        m3, m4, m5 = s[_M + 3 * L + i], s[_M + 4 * L + i], s[_M + 5 * L + i]
        u, v, w = m0 * f00, m1 * f00, m2 * f00
        s[_W + i], s[_W + L + i], s[_W + 2 * L + i] = u, v, w
        s[_W + 3 * L + i], s[_W + 4 * L + i], s[_W + 5 * L + i] = y * w - z * v, z * u - x * w, x * v - y * u
        u, v, w = m0 * f10 + m1 * f11, m1 * f10 + m3 * f11, m2 * f10 + m4 * f11
        s[_W + 6 * L + i], s[_W + 7 * L + i], s[_W + 8 * L + i] = u, v, w
        s[_W + 9 * L + i], s[_W + 10 * L + i] = y * w - z * v, z * u - x * w
        s[_W + 11 * L + i] = x * v - y * u
        u = m0 * f20 + m1 * f21 + m2 * f22
        v = m1 * f20 + m3 * f21 + m4 * f22
        w = m2 * f20 + m4 * f21 + m5 * f22
        s[_W + 12 * L + i], s[_W + 13 * L + i], s[_W + 14 * L + i] = u, v, w
        s[_W + 15 * L + i], s[_W + 16 * L + i] = y * w - z * v, z * u - x * w
        s[_W + 17 * L + i] = x * v - y * u
    t0, t1, t2, t3, t4, t5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(lanes):
        h0, h1, h2 = s[_HALF + i], s[_HALF + L + i], s[_HALF + 2 * L + i]
        t0 += s[_W + i] * h0 + s[_W + 6 * L + i] * h1 + s[_W + 12 * L + i] * h2
        t1 += s[_W + L + i] * h0 + s[_W + 7 * L + i] * h1 + s[_W + 13 * L + i] * h2
        t2 += s[_W + 2 * L + i] * h0 + s[_W + 8 * L + i] * h1 + s[_W + 14 * L + i] * h2
        t3 += s[_W + 3 * L + i] * h0 + s[_W + 9 * L + i] * h1 + s[_W + 15 * L + i] * h2
        t4 += s[_W + 4 * L + i] * h0 + s[_W + 10 * L + i] * h1 + s[_W + 16 * L + i] * h2
        t5 += s[_W + 5 * L + i] * h0 + s[_W + 11 * L + i] * h1 + s[_W + 17 * L + i] * h2
    taken[at] -= t0
    taken[at + 1] -= t1
    taken[at + 2] -= t2
    taken[at + 3] -= t3
    taken[at + 4] -= t4
    taken[at + 5] -= t5
    for b in range(3):
        store_by_lanes(s, _W + 6 * b * L, out, b * columns + at, 3 * columns)


@part
def _scatter(
    product: Array,
    columns: int,
    taken: Array,
    keyframes: Index,
    first: int,
    column: Index,
    stride: int,
    base: int,
    storage: Array,
    gradient: Array,
) -> None:
    """Subtract a product over keyframes (``columns`` squared, flat) from the stored triangle; add ``taken``.

    Its keyframes stand at ``first``.. of ``keyframes``; its entries with column >= row are filled.
    """
    for i in range(columns // 6):
        left = column[keyframes[first + i]]
        for a in range(6):
            gradient[left + a] += taken[6 * i + a]
            row, start = (6 * i + a) * columns + 6 * i, (left + a) * stride + left - base
            for b in range(a, 6):
                storage[start + b] -= product[row + b]
        for j in range(i + 1, columns // 6):
            right, row = column[keyframes[first + j]], 6 * i * columns + 6 * j
            if right > left:
                for a in range(6):
                    start = (left + a) * stride + right - base
                    for b in range(6):
                        storage[start + b] -= product[row + a * columns + b]
            else:
                for b in range(6):
                    start = (right + b) * stride + left - base
                    for a in range(6):
                        storage[start + a] -= product[row + a * columns + b]


@kernel
def eliminate(
    information: Array,
    p_W: Array,
    X_W: Array,
    landmark: Array,
    damping: Array,
    landmark_gradient: Array,
    group_batch: Index,
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
    *batches: Index,
) -> float:
    """Take the landmarks of a range of groups out of the motion block and its gradient (9N,).

    ``damping`` (9N + 3K,), which may be empty, is added to the diagonals of ``landmark`` (K, 3, 3).
    Fills ``factor`` (B, 6 L), the lower triangle by columns, and ``half_gradient`` (B, 3 L), see
    :func:`_factorise`, and returns its number. Entry (r, c) of the stored lower triangle is
    ``storage[c * stride + r - base]``.
    """
    order, batch_begin, batch_cell, cell_keyframe, cell_row, _, _ = batches
    lanes = factor.shape[1] // 6
    widest = 0
    for g in range(first_group, end_group):
        widest = max(widest, 6 * (group_seen[g + 1] - group_seen[g]))
    s = np.empty(_ROWS * L)
    spread, product, taken = np.empty(3 * L * widest), np.empty(widest * widest), np.empty(widest)
    size = np.empty(4, dtype=np.int32)
    smallest = 1.0
    for g in range(first_group, end_group):
        width, of_group = 6 * (group_seen[g + 1] - group_seen[g]), group_seen[g]
        begun = False
        for b in range(group_batch[g], group_batch[g + 1]):
            begin, last = batch_begin[b], batch_begin[b + 1] - 1
            gather_points(begin, last, order, X_W, lanes, s)
            found = _factorise(
                begin, last, order, landmark, damping, len(gradient), landmark_gradient, lanes, s
            )
            smallest = min(smallest, found)
            for i in range(6 * lanes):
                factor[b, i] = s[_F + i]
            for i in range(3 * lanes):
                half_gradient[b, i] = s[_HALF + i]
            first, end = batch_cell[b], batch_cell[b + 1]
            low, high, own = 6 * cell_row[first], 6 * cell_row[end - 1] + 6, 6 * (end - first)
            # Keyframes far apart get a product of their own; the group's must then be out of the way.
            apart = high - low > LONG_GAPS * own
            if apart and begun:
                _scatter(product, width, taken, seen, of_group, column, stride, base, storage, gradient)
                begun = False
            rows, columns = 3 * (last + 1 - begin), own if apart else width
            if not begun:
                product[: columns * columns] = 0.0
                taken[:columns] = 0.0
            if apart:
                low, high = 0, own
            elif high - low > own:
                spread[: rows * columns] = 0.0
            for cell in range(first, end):
                k, at = cell_keyframe[cell], 6 * (cell - first) if apart else 6 * cell_row[cell]
                _spread(cell, k, at, information, p_W, lanes, s, spread, columns, taken)
            blas.add_gram(spread, rows, columns, low, high, product, size)
            if apart:
                _scatter(product, own, taken, cell_keyframe, first, column, stride, base, storage, gradient)
            begun = not apart
        if begun:
            _scatter(product, width, taken, seen, of_group, column, stride, base, storage, gradient)
    return smallest


@kernel
def back_substitute(
    information: Array,
    p_W: Array,
    X_W: Array,
    factor: Array,
    half_gradient: Array,
    column: Index,
    motion: Array,
    out: Array,
    *batches: Index,
) -> None:
    """Landmark steps -F^T (F g + F W^T x) into ``out`` (K, 3), for the motion step x (9N,) in stored order.

    W^T (x_p, x_r) = -M (x_p - ray x x_r), and ray = X - p: what the keyframe gives is added up once.
    """
    order, batch_begin, batch_cell, cell_keyframe, _, _, _ = batches
    lanes = factor.shape[1] // 6
    frame = np.empty((len(p_W), 6))
    for k in range(len(p_W)):
        at = column[k]
        r0, r1, r2 = motion[at + 3], motion[at + 4], motion[at + 5]
        x, y, z = p_W[k, 0], p_W[k, 1], p_W[k, 2]
        frame[k, 0] = motion[at] + y * r2 - z * r1
        frame[k, 1] = motion[at + 1] + z * r0 - x * r2
        frame[k, 2] = motion[at + 2] + x * r1 - y * r0
        frame[k, 3], frame[k, 4], frame[k, 5] = r0, r1, r2
    s = np.empty(_ROWS * L)
    for b in range(len(factor)):
        first, end = batch_begin[b], batch_begin[b + 1]
        gather_points(first, end - 1, order, X_W, lanes, s)
        _load_factor(b, factor, s)
        for i in range(3 * lanes):
            s[_W + i] = 0.0
        for cell in range(batch_cell[b], batch_cell[b + 1]):
            k = cell_keyframe[cell]
            p0, p1, p2 = frame[k, 0], frame[k, 1], frame[k, 2]
            r0, r1, r2 = frame[k, 3], frame[k, 4], frame[k, 5]
            _load_cell(cell, information, s)
            for i in range(lanes):
                x, y, z = s[i], s[L + i], s[2 * L + i]
                y0, y1, y2 = p0 - y * r2 + z * r1, p1 - z * r0 + x * r2, p2 - x * r1 + y * r0
                m1, m2, m4 = s[_M + L + i], s[_M + 2 * L + i], s[_M + 4 * L + i]
                s[_W + i] -= s[_M + i] * y0 + m1 * y1 + m2 * y2
                s[_W + L + i] -= m1 * y0 + s[_M + 3 * L + i] * y1 + m4 * y2
                s[_W + 2 * L + i] -= m2 * y0 + m4 * y1 + s[_M + 5 * L + i] * y2
        for i in range(3 * lanes):
            s[_HALF + i] = half_gradient[b, i]
        for i in range(lanes):
            t0, t1, t2 = s[_W + i], s[_W + L + i], s[_W + 2 * L + i]
            f00, f10, f20 = s[_F + i], s[_F + L + i], s[_F + 2 * L + i]
            f11, f21, f22 = s[_F + 3 * L + i], s[_F + 4 * L + i], s[_F + 5 * L + i]
            r0 = -s[_HALF + i] - f00 * t0
            r1 = -s[_HALF + L + i] - f10 * t0 - f11 * t1
            r2 = -s[_HALF + 2 * L + i] - f20 * t0 - f21 * t1 - f22 * t2
            s[_W + i] = f00 * r0 + f10 * r1 + f20 * r2
            s[_W + L + i] = f11 * r1 + f21 * r2
            s[_W + 2 * L + i] = f22 * r2
        for i in range(end - first):
            j = order[first + i]
            out[j, 0], out[j, 1], out[j, 2] = s[_W + i], s[_W + L + i], s[_W + 2 * L + i]


@kernel
def _couple(
    d: int, W: Couplings, factor: Array, batches: Batches, landmark: Array, out: Array, gram: Array
) -> None:
    information, p_W, X_W = W
    order, batch_begin, batch_cell, cell_keyframe, _, _, _ = batches
    lanes = factor.shape[1] // 6
    s, v = np.empty(_ROWS * L), np.empty(6 * d * L)
    # Rows of v: F V, then C^-1 V.
    for b in range(len(factor)):
        first, end = batch_begin[b], batch_begin[b + 1]
        gather_points(first, end - 1, order, X_W, lanes, s)
        _load_factor(b, factor, s)
        for i in range(3 * d * lanes):
            v[i] = 0.0
        for i in range(end - first):
            j = order[first + i]
            for a in range(3):
                for c in range(d):
                    v[(d * a + c) * L + i] = landmark[j, a, c]
        for c in range(d):
            for i in range(lanes):
                v0, v1, v2 = v[c * L + i], v[(d + c) * L + i], v[(2 * d + c) * L + i]
                f00, f10, f20 = s[_F + i], s[_F + L + i], s[_F + 2 * L + i]
                f11, f21, f22 = s[_F + 3 * L + i], s[_F + 4 * L + i], s[_F + 5 * L + i]
                h0, h1, h2 = f00 * v0, f10 * v0 + f11 * v1, f20 * v0 + f21 * v1 + f22 * v2
                v[c * L + i], v[(d + c) * L + i], v[(2 * d + c) * L + i] = h0, h1, h2
                v[(3 * d + c) * L + i] = f00 * h0 + f10 * h1 + f20 * h2
                v[(4 * d + c) * L + i] = f11 * h1 + f21 * h2
                v[(5 * d + c) * L + i] = f22 * h2
        for c in range(d):
            for e in range(c, d):
                total = 0.0
                for i in range(lanes):
                    total += v[c * L + i] * v[e * L + i]
                    total += v[(d + c) * L + i] * v[(d + e) * L + i]
                    total += v[(2 * d + c) * L + i] * v[(2 * d + e) * L + i]
                gram[c, e] += total
        for cell in range(batch_cell[b], batch_cell[b + 1]):
            k = cell_keyframe[cell]
            px, py, pz = p_W[k, 0], p_W[k, 1], p_W[k, 2]
            _load_cell(cell, information, s)
            for c in range(d):
                t0, t1, t2, t3, t4, t5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
                for i in range(lanes):
                    x, y, z = s[i] - px, s[L + i] - py, s[2 * L + i] - pz
                    v0, v1, v2 = v[(3 * d + c) * L + i], v[(4 * d + c) * L + i], v[(5 * d + c) * L + i]
                    m1, m2, m4 = s[_M + L + i], s[_M + 2 * L + i], s[_M + 4 * L + i]
                    u0 = s[_M + i] * v0 + m1 * v1 + m2 * v2
                    u1 = m1 * v0 + s[_M + 3 * L + i] * v1 + m4 * v2
                    u2 = m2 * v0 + m4 * v1 + s[_M + 5 * L + i] * v2
                    t0 += u0
                    t1 += u1
                    t2 += u2
                    t3 += y * u2 - z * u1
                    t4 += z * u0 - x * u2
                    t5 += x * u1 - y * u0
                out[0, k, 0, c] -= t0
                out[0, k, 1, c] -= t1
                out[0, k, 2, c] -= t2
                out[1, k, 0, c] -= t3
                out[1, k, 1, c] -= t4
                out[1, k, 2, c] -= t5
    for c in range(d):
        for e in range(c):
            gram[c, e] = gram[e, c]


@kernel
def couple(W: Couplings, factor: Array, batches: Batches, landmark: Array, out: Array, gram: Array) -> None:
    """Add W C^-1 V to ``out`` (3, N, 3, d), by kind and keyframe, and V^T C^-1 V to ``gram`` (d, d).

    V (K, 3, d) are landmark columns, as many as a gauge has constraints. ``out`` and ``gram`` start
    as zeros.
    """
    # A number that the compiler knows halves the time of the usual gauge.
    if landmark.shape[2] == GAUGE:
        _couple(GAUGE, W, factor, batches, landmark, out, gram)
    else:
        _couple(landmark.shape[2], W, factor, batches, landmark, out, gram)
