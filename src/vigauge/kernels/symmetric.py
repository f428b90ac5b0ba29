"""Symmetric matrices: unpacked from LAPACK's triangle, updated in low rank, with columns held."""

from __future__ import annotations

import math

import numpy as np

from ..geometry.so3 import Array
from .compiled import kernel, part
from .lanes import Index


@part
def unpack(lower: Array, stored: Index, out: Array) -> None:
    """Full matrix in another order: out[i, j] = lower[stored[i], stored[j]], of which r >= c is filled."""
    for i in range(len(stored)):
        r = stored[i]
        for j in range(i + 1):
            c = stored[j]
            value = lower[r, c] if r >= c else lower[c, r]
            out[i, j] = value
            out[j, i] = value


@kernel
def project_blocks(G: Array, A: Array, W: Array, rows: Index) -> None:
    """G_b <- G_b - A_b W_b^T - W_b A_b^T for (m, c, c) G and the ``rows`` (m, c) of (n, d) A and W.

    Exactly symmetric, from the lower triangles; variances that rounding made negative are zero.
    """
    d = A.shape[1]
    for b in range(len(G)):
        for i in range(rows.shape[1]):
            r = rows[b, i]
            for j in range(i + 1):
                s = rows[b, j]
                value = G[b, i, j]
                for k in range(d):
                    value -= A[r, k] * W[s, k] + W[r, k] * A[s, k]
                G[b, i, j] = value
                G[b, j, i] = value
            G[b, i, i] = max(G[b, i, i], 0.0)


@part
def largest_ratio(inverse: Array, A: Array) -> float:
    """The largest |A^-1| by the diagonal of A: one where A is diagonal, NaN where it has one."""
    largest = 0.0
    for i in range(len(A)):
        for j in range(len(A)):
            ratio = abs(inverse[i, j]) * math.sqrt(A[i, i] * A[j, j])
            if math.isnan(ratio):
                return ratio
            largest = max(largest, ratio)
    return largest


@kernel
def subtract_outer(G: Array, A: Array, W: Array) -> None:
    """G <- G - A W^T - W A^T for (n, d) A and W; exactly symmetric, from the lower triangle of G."""
    n, d = A.shape
    # By columns, four at a time, so that a row of G is a sum of eight rows.
    padded = (d + 3) // 4 * 4
    A_T, W_T = np.zeros((padded, n)), np.zeros((padded, n))
    for i in range(n):  # an assignment of arrays takes six seconds to compile
        for c in range(d):
            A_T[c, i], W_T[c, i] = A[i, c], W[i, c]
    for c in range(0, padded, 4):
        for i in range(n):
            a0, a1, a2, a3 = A_T[c, i], A_T[c + 1, i], A_T[c + 2, i], A_T[c + 3, i]
            w0, w1, w2, w3 = W_T[c, i], W_T[c + 1, i], W_T[c + 2, i], W_T[c + 3, i]
            for j in range(i + 1):
                value = a0 * W_T[c, j] + a1 * W_T[c + 1, j] + a2 * W_T[c + 2, j] + a3 * W_T[c + 3, j]
                value += w0 * A_T[c, j] + w1 * A_T[c + 1, j] + w2 * A_T[c + 2, j] + w3 * A_T[c + 3, j]
                G[i, j] -= value
    for i in range(G.shape[0]):
        for j in range(i):
            G[j, i] = G[i, j]


@part
def clear(storage: Array, size: int, stride: int, half_bandwidth: int) -> None:
    """Zeros in a triangle stored as in :func:`hold`; what is not part of it stays as it was."""
    for c in range(size):
        column = storage[c * (stride + 1) : c * stride + min(c + half_bandwidth + 1, size)]
        for i in range(len(column)):
            column[i] = 0.0


@part
def copy(storage: Array, size: int, stride: int, half_bandwidth: int, out: Array) -> None:
    """A triangle stored as in :func:`hold` into ``out``; what is not part of it stays as it was there."""
    for c in range(size):
        start, end = c * (stride + 1), c * stride + min(c + half_bandwidth + 1, size)
        column, to = storage[start:end], out[start:end]
        for i in range(len(column)):
            to[i] = column[i]


@part
def hold(storage: Array, held: Index, stored: Index, stride: int, half_bandwidth: int) -> None:
    """Rows and columns of the identity in a stored lower triangle: (r, c) is ``storage[c * stride + r]``.

    ``held`` in the order of ``stored``.
    """
    size = len(stored)
    for column in held:
        at = stored[column]
        for r in range(at + 1, min(at + half_bandwidth, size - 1) + 1):
            storage[at * stride + r] = 0.0
        for c in range(max(at - half_bandwidth, 0), at):
            storage[c * stride + at] = 0.0
        storage[at * stride + at] = 1.0


@part
def add_factor(
    storage: Array, gradient: Array, at: Index, stride: int, jacobian: Array, residual: Array
) -> None:
    """Add J^T J over distinct columns to a triangle stored as in :func:`hold`, J^T r to the gradient."""
    for i in range(len(at)):
        total = 0.0
        for m in range(len(residual)):
            total += jacobian[m, i] * residual[m]
        gradient[at[i]] += total
        for j in range(len(at)):
            if at[i] >= at[j]:
                total = 0.0
                for m in range(len(residual)):
                    total += jacobian[m, i] * jacobian[m, j]
                storage[at[j] * stride + at[i]] += total


@part
def add_diagonal_and_gradient(
    diagonal: Array, gradient: Array, at: Index, jacobian: Array, residual: Array
) -> None:
    """Add the diagonal of J^T J, and J^T r, at distinct entries."""
    for i in range(len(at)):
        for m in range(len(residual)):
            diagonal[at[i]] += jacobian[m, i] * jacobian[m, i]
            gradient[at[i]] += jacobian[m, i] * residual[m]


@kernel
def pivots(N: Array) -> Index:
    """(k,) rows of N (n, k), each the farthest from the span of those before; N is overwritten."""
    n, k = N.shape
    out, unit = np.empty(k, dtype=np.int64), np.empty(k)
    for step in range(k):
        best, largest = 0, -1.0
        for r in range(n):
            square = 0.0
            for c in range(k):
                square += N[r, c] * N[r, c]
            if square > largest:
                best, largest = r, square
        out[step] = best
        length = math.sqrt(max(largest, 1e-300))
        for c in range(k):
            unit[c] = N[best, c] / length
        for r in range(n):
            along = 0.0
            for c in range(k):
                along += N[r, c] * unit[c]
            for c in range(k):
                N[r, c] -= along * unit[c]
    return out


@kernel
def exactly_symmetric(begin: Index, row: Index, data: Array, diagonal: Array) -> bool:
    """Whether A, in compressed columns with sorted rows, is symmetric to the last bit, pattern included.

    Diagonal entries that are stored go to ``diagonal`` (n,).
    """
    # Where each column continues: the rows of its lower part are met in order while the columns pass.
    ahead = begin[:-1].copy()
    same = True
    for j in range(len(diagonal)):
        rows, values = row[begin[j] : begin[j + 1]], data[begin[j] : begin[j + 1]]
        upper = 0
        while upper < len(rows) and rows[upper] < j:
            upper += 1
        ahead[j] += upper
        if upper < len(rows) and rows[upper] == j:
            diagonal[j] = values[upper]
            ahead[j] += 1
        for e in range(upper):
            i = np.uint64(rows[e])  # the compiler then knows that it is not negative
            at = ahead[i]
            if not (at < begin[rows[e] + 1] and row[at] == j and data[at] == values[e]):
                same = False
            else:
                ahead[i] += 1
    for j in range(len(diagonal)):
        same &= ahead[j] == begin[j + 1]
    return same


@kernel
def largest_asymmetry(
    begin: Index, row: Index, data: Array, size: Array, tolerance: float
) -> tuple[float, int, int]:
    """By how much |A_ij - A_ji| exceeds tolerance size_i size_j at most, and where.

    A in compressed columns with sorted rows; what is not stored is zero. Zeros where nothing exceeds.
    """
    n = len(size)
    worst, at_i, at_j = 0.0, 0, 0
    # Where each column continues: the rows of its lower part are met in order while the columns pass.
    ahead = np.empty(n, np.int64)
    for j in range(n + 1):
        first, end = (begin[j], begin[j + 1]) if j < n else (0, n)
        if j < n:
            ahead[j] = end
        for e in range(first, end):
            i = row[e] if j < n else e
            if i >= j:
                ahead[j] = e
                if i == j:
                    ahead[j] = e + 1
                break
            partner = 0.0
            while ahead[i] < begin[i + 1] and row[ahead[i]] <= j:
                value, r = data[ahead[i]], row[ahead[i]]
                ahead[i] += 1
                if r == j:
                    partner = value
                elif abs(value) - tolerance * size[i] * size[r] > worst:
                    worst, at_i, at_j = abs(value) - tolerance * size[i] * size[r], r, i
            if j < n and abs(data[e] - partner) - tolerance * size[i] * size[j] > worst:
                worst, at_i, at_j = abs(data[e] - partner) - tolerance * size[i] * size[j], i, j
    return worst, at_i, at_j
