"""Cholesky factor of a large sparse matrix by fronts, solutions with it, and chosen entries of the inverse.

A front has its columns J and the rows B below that they reach. Its panel, columns of L over J and B, stands
column by column in a storage, as LAPACK takes it; see :class:`.elimination.Fronts`.
"""

from __future__ import annotations

import numpy as np

from ..geometry.so3 import Array
from .blas import Sizes, add_gram, multiply, solve_right
from .cholesky import WIDEST_OWN, factorise_panel, subtract, subtract_four
from .compiled import kernel, part
from .elimination import Fronts
from .lanes import Index


@part
def _runs(at: Index, ends: Index) -> None:
    """Where the run of consecutive places ends that each of ``at`` stands in."""
    for t in range(len(at) - 1, -1, -1):
        ends[t] = ends[t + 1] if t + 1 < len(at) and at[t + 1] == at[t] + 1 else t + 1


@part
def _add(A: Array, count: int, out: Array) -> None:
    for t in range(count):
        out[t] += A[t]


@part
def _copy(A: Array, count: int, out: Array) -> None:
    for t in range(count):
        out[t] = A[t]


@part
def invert_panel(panel: Array, s: int, m: int, XY: Array, size: Sizes) -> None:
    """X = L_JJ^-1 above Y = -L_BJ X into ``XY``, column by column as the panel."""
    for c in range(s):
        X, Y, L = XY[c * m : c * m + s], XY[c * m + s : (c + 1) * m], panel[c * m + s : (c + 1) * m]
        for t in range(s):
            X[t] = 0.0
        X[c] = 1.0
        for t in range(len(Y)):
            Y[t] = -L[t]
    if s > WIDEST_OWN:
        solve_right(panel, m, False, m, s, XY, m, size)
        return
    for c in range(s - 1, -1, -1):
        column, own = XY[c * m : (c + 1) * m], panel[c * m : (c + 1) * m]
        k = c + 1
        while k + 4 <= s:
            A, B = XY[k * m + k :], XY[(k + 1) * m + k :]
            C, D = XY[(k + 2) * m + k :], XY[(k + 3) * m + k :]
            subtract_four(own[k], A, own[k + 1], B, own[k + 2], C, own[k + 3], D, column[k:])
            k += 4
        while k < s:
            subtract(own[k], XY[k * m + k : (k + 1) * m], column[k:])
            k += 1
        scale = 1.0 / own[c]
        for t in range(len(column)):
            column[t] *= scale


@kernel
def factorise(
    fronts: Fronts,
    begin: Index,
    row: Index,
    data: Array,
    scale: Array,
    order: Index,
    place: Index,
    lift: float,
    out: Array,
) -> tuple[int, float]:
    """Fill in the panels of L, of D A D + lift I with D = diag(scale) and A in compressed columns.

    ``order`` names the columns of A in elimination order, ``place`` (n,) is its inverse, -1 for columns left
    out. Returns -1 and 0, or the place and size of a pivot that is not positive.
    """
    count = len(fronts.parent)
    largest, top, peak = 0, 0, 0
    waiting = np.zeros(count + 1, np.int64)
    for f in range(count):
        b = fronts.begin[f + 1] - fronts.begin[f]
        largest = max(largest, fronts.start[f + 1] - fronts.start[f] + b)
        # The last entry is never asked for.
        waiting[fronts.parent[f]] += b * b
        top += b * b - waiting[f]
        peak = max(peak, top)
    # What eliminated fronts take from later ones, lower triangles, those of a front's children last.
    taken, pending, depth, top = np.empty(peak), np.empty(count, np.int64), 0, 0
    whole, spot = np.empty(largest * largest), np.empty(len(order), np.int64)
    size, ends = np.empty(4, np.int32), np.empty(largest, np.int64)
    for f in range(count):
        start, stop = fronts.start[f], fronts.start[f + 1]
        rows = fronts.rows[fronts.begin[f] : fronts.begin[f + 1]]
        s, b = stop - start, len(rows)
        m = s + b
        whole[: m * m] = 0.0
        while depth and fronts.parent[pending[depth - 1]] == f:
            depth -= 1
            child = pending[depth]
            at = fronts.relative[fronts.begin[child] : fronts.begin[child + 1]]
            _runs(at, ends)
            top -= len(at) * len(at)
            for c in range(len(at)):
                r = c
                while r < len(at):
                    _add(taken[top + c * len(at) + r :], ends[r] - r, whole[at[c] * m + at[r] :])
                    r = ends[r]
        panel = out[fronts.panel[f] : fronts.panel[f + 1]]
        for k in range(s * m):
            panel[k] = -whole[k]
        for t in range(b):
            spot[rows[t]] = s + t
        for t in range(s):
            spot[start + t] = t
        for c in range(s):
            column = order[start + c]
            first, end, size_of = begin[column], begin[column + 1], scale[column]
            into, rows_of, values = panel[c * m : (c + 1) * m], row[first:end], data[first:end]
            for e in range(len(values)):
                i = np.uint64(rows_of[e])
                at_row = place[i]
                if at_row >= start + c:
                    into[np.uint64(spot[np.uint64(at_row)])] += values[e] * size_of * scale[i]
            into[c] += lift
        wrong = factorise_panel(panel, s, m, m, size)
        if wrong:
            return start + wrong - 1, panel[(wrong - 1) * (m + 1)]
        if b:
            add_gram(panel, s, m, s, m, whole, size)
            for c in range(b):
                _copy(whole[(s + c) * m + s + c :], b - c, taken[top + c * b + c :])
            top += b * b
            pending[depth] = f
            depth += 1
    return -1, 0.0


@part
def _forward(fronts: Fronts, panels: Array, f: int, c: int, X: Array, some: Array, size: Sizes) -> None:
    """One front of X <- L^-1 X, for X (n, c) flat, row by row."""
    start, s = fronts.start[f], fronts.start[f + 1] - fronts.start[f]
    rows = fronts.rows[fronts.begin[f] : fronts.begin[f + 1]]
    panel, m, own = panels[fronts.panel[f] :], s + len(rows), X[start * c :]
    solve_right(panel, m, True, c, s, own, c, size)
    if len(rows):
        multiply(own, c, False, panel[s:], m, True, c, len(rows), s, 1, 0, some, c, size)
        for t in range(len(rows)):
            for k in range(c):
                X[rows[t] * c + k] -= some[t * c + k]


@kernel
def solve(fronts: Fronts, panels: Array, X: Array) -> None:
    """Replace right-hand sides (n, c) by the solutions."""
    c = X.shape[1]
    flat, some, size = X.reshape(-1), np.empty(X.size), np.empty(6, np.int32)
    for f in range(len(fronts.parent)):
        _forward(fronts, panels, f, c, flat, some, size)
    for f in range(len(fronts.parent) - 1, -1, -1):
        start, s = fronts.start[f], fronts.start[f + 1] - fronts.start[f]
        rows = fronts.rows[fronts.begin[f] : fronts.begin[f + 1]]
        panel, m, own = panels[fronts.panel[f] :], s + len(rows), flat[start * c :]
        for t in range(len(rows)):
            for k in range(c):
                some[t * c + k] = flat[rows[t] * c + k]
        if len(rows):
            multiply(some, c, False, panel[s:], m, False, c, s, len(rows), -1, 1, own, c, size)
        solve_right(panel, m, False, c, s, own, c, size)


@kernel
def gram(fronts: Fronts, panels: Array, path: Index, X: Array, out: Array) -> None:
    """Add X^T A^-1 X to ``out`` (c, c), for X (n, c) that is zero outside some fronts and overwritten.

    ``path`` are these fronts and all that they lead to, in elimination order.
    """
    c = X.shape[1]
    flat, some, size = X.reshape(-1), np.empty(X.size), np.empty(6, np.int32)
    for f in path:
        _forward(fronts, panels, f, c, flat, some, size)
        start, s = fronts.start[f], fronts.start[f + 1] - fronts.start[f]
        own = flat[start * c :]
        multiply(own, c, False, own, c, True, c, c, s, 1, 1, out.reshape(-1), c, size)


@kernel
def select(fronts: Fronts, panels: Array, out: Array) -> None:
    """Entries of the inverse Z that stand where the panels have entries: both triangles of J, and B below.

    With X = L_JJ^-1 and Y = -L_BJ X, last front first (Takahashi, Fagan and Chin 1973):
    Z_BJ = Z_BB Y and Z_JJ = X^T X + Y^T Z_BJ. Z_BB lies inside the parent.
    """
    count = len(fronts.parent)
    peak, largest, tallest = np.zeros(count + 1, np.int64), 0, 0
    children = np.zeros(count + 1, np.int64)
    for f in range(count - 1, -1, -1):
        m = fronts.start[f + 1] - fronts.start[f] + fronts.begin[f + 1] - fronts.begin[f]
        peak[f] = peak[fronts.parent[f]] + m * m
        largest, tallest = max(largest, fronts.panel[f + 1] - fronts.panel[f]), max(tallest, m)
        children[fronts.parent[f]] += 1
    # Z over all rows of the fronts between the one at work and the root; X above Y.
    wholes, XY, size = np.empty(peak.max()), np.empty(largest), np.empty(6, np.int32)
    own, ends = np.empty(largest), np.empty(tallest, np.int64)
    for f in range(count - 1, -1, -1):
        parent, s = fronts.parent[f], fronts.start[f + 1] - fronts.start[f]
        at = fronts.relative[fronts.begin[f] : fronts.begin[f + 1]]
        panel, b = panels[fronts.panel[f] : fronts.panel[f + 1]], len(at)
        m = s + b
        Z = wholes[peak[parent] : peak[f]]
        invert_panel(panel, s, m, XY, size)
        for c in range(s):
            _copy(XY[c * m :], s, Z[c * m :])
        if b:
            width = fronts.start[parent + 1] - fronts.start[parent]
            width += fronts.begin[parent + 1] - fronts.begin[parent]
            above = wholes[peak[fronts.parent[parent]] : peak[parent]]
            _runs(at, ends)
            for c in range(b):
                r = 0
                while r < b:
                    _copy(above[at[c] * width + at[r] :], ends[r] - r, Z[(s + c) * m + s + r :])
                    r = ends[r]
            multiply(Z[s * (m + 1) :], m, False, XY[s:], m, False, b, s, b, 1, 0, Z[s:], m, size)
        multiply(XY, m, True, Z, m, False, s, s, m, 1, 0, own, s, size)
        for c in range(s):
            for r in range(s):
                Z[c * m + r] = 0.5 * (own[c * s + r] + own[r * s + c])
        _copy(Z, s * m, out[fronts.panel[f] :])
        if children[f]:
            for r in range(s, m):
                for c in range(s):
                    Z[r * m + c] = Z[c * m + r]


@kernel
def blocks(fronts: Fronts, selected: Array, owner: Index, at: Index, out: Array) -> Index:
    """Fill in ``out`` (m, c, c) with the entries of the inverse over places ``at`` (m, c), -1 for zeros.

    ``owner`` (n,) front of each place. Returns the sets of which entries were not selected.
    """
    missing = np.zeros(len(at), np.bool_)
    for k in range(len(at)):
        # As a rule all columns of a keyframe stand in one front.
        lowest = at[k].min() if at.shape[1] else -1
        if lowest >= 0 and at[k].max() < fronts.start[owner[lowest] + 1]:
            f = owner[lowest]
            whole = selected[fronts.panel[f] : fronts.panel[f + 1]]
            m = len(whole) // (fronts.start[f + 1] - fronts.start[f])
            for i in range(at.shape[1]):
                for j in range(at.shape[1]):
                    out[k, i, j] = whole[(at[k, i] - fronts.start[f]) * m + at[k, j] - fronts.start[f]]
            continue
        for i in range(at.shape[1]):
            for j in range(i + 1):
                low, high = min(at[k, i], at[k, j]), max(at[k, i], at[k, j])
                value = 0.0
                if low >= 0:
                    f = owner[low]
                    start, stop = fronts.start[f], fronts.start[f + 1]
                    rows = fronts.rows[fronts.begin[f] : fronts.begin[f + 1]]
                    r = high - start
                    if high >= stop:
                        r = np.searchsorted(rows, high)
                        missing[k] |= r == len(rows) or rows[r] != high
                        r += stop - start
                    if not missing[k]:
                        value = selected[fronts.panel[f] + (low - start) * (stop - start + len(rows)) + r]
                out[k, i, j] = out[k, j, i] = value
    return np.flatnonzero(missing)
