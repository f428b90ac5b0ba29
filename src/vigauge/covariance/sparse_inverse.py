"""Chosen blocks of the inverse of a large sparse matrix, without the inverse.

SuperLU factorises A = L D L^T in an order that keeps L sparse. Columns of one keyframe or point stay
together (a node); nodes with alike columns of L are merged (a front). With J the columns of a front, B the
rows below that its columns of L reach, and Y = L_BJ L_JJ^-1,

    Z_BJ = -Z_BB Y,    Z_JJ = (L_JJ D_J L_JJ^T)^-1 - Z_BJ^T Y,

last front first (Takahashi, Fagan and Chin 1973): Z_BB lies inside the front that holds the first row of B.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg.lapack as lapack
import scipy.sparse as sparse
from scipy.linalg.blas import dtrsm
from scipy.sparse.linalg import splu

from ..errors import DegenerateError, IndefiniteError
from ..gauge.layout import Index
from ..geometry.so3 import Array
from ..sparsity.rounding import rounding
from .inverses import largest_of_inverse, node_pairs

# What a singular matrix is lifted by, in units of its rounding, to see whether it has negative eigenvalues.
_LIFT = 1e3
# Fronts of fewer columns are merged with the next where that adds few zeros (measured).
_NARROW = 48
_ZEROS = 0.25
# Right-hand sides that are solved at a time.
_AT_ONCE = 64


@dataclass(frozen=True, eq=False)
class _Front:
    """Columns J (a range of the elimination order) and the rows B below them, sorted."""

    start: int
    stop: int
    below: Index
    parent: int

    @cached_property
    def rows(self) -> Index:
        return np.concatenate([np.arange(self.start, self.stop), self.below])


def dissected(row: Index, column: Index, rank: Index) -> Index:
    """Nodes of a band in an order of which every path from a node to the last is short (nested dissection).

    ``rank`` places of the nodes that make the band. The middle of every stretch comes after both its sides.
    """
    reach = int(np.max(np.abs(rank[row] - rank[column]), initial=1))
    order: list[Index] = []
    stack = [(0, len(rank))]
    while stack:
        low, high = stack.pop()
        middle = (low + high) // 2 if high - low > 4 * reach else low
        stop = middle + reach if high - low > 4 * reach else high
        order.append(np.arange(middle, stop))
        stack += [(low, middle), (stop, high)] if stop < high else []
    return np.argsort(rank)[np.concatenate(order[::-1])]


def _eliminated(row: Index, column: Index, order: Index) -> tuple[Index, list[list[int]]]:
    """Nodes in an elimination order as sparse as the one given, and the places that L reaches below each.

    Children stand before parents, one branch after the other.
    """
    count = len(order)
    place = np.argsort(order)
    lower = place[row] > place[column]
    row, column = place[row[lower]], place[column[lower]]
    by_column = np.argsort(column, kind="stable")
    reach = np.split(row[by_column], np.searchsorted(column[by_column], np.arange(1, count)))
    below: list[set[int]] = [set(own.tolist()) for own in reach]
    parent, children = [-1] * count, [[] for _ in range(count + 1)]  # type: ignore[var-annotated]
    for k, rows in enumerate(below):
        if rows:
            parent[k] = min(rows)
            below[parent[k]] |= rows
            below[parent[k]].discard(parent[k])
        children[parent[k]].append(k)
    after: list[int] = []
    stack = children[-1][:]
    while stack:
        k = stack.pop()
        after.append(k)
        stack += children[k]
    old = np.array(after[::-1], dtype=np.int64)
    new = np.argsort(old)
    return order[old], [np.sort(new[list(below[k])]).tolist() for k in old]


def _sparse_order(row: Index, column: Index, count: int) -> Index:
    """Nodes in an order that keeps the factor sparse: minimum degree."""
    values = np.where(row == column, 1.0, -1e-3 / count)
    graph = sparse.csc_array((values, (row, column)), (count, count))
    lu = splu(graph, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return np.argsort(lu.perm_c)


def _fronts(below: list[list[int]], sizes: Index) -> list[_Front]:
    """Nodes merged into fronts: chains whose columns of L reach the same rows, or nearly so."""
    begin = np.concatenate([[0], np.cumsum(sizes)])
    count = [int(sizes[rows].sum()) for rows in below]
    merged: list[tuple[int, int]] = []
    start = 0
    for k, rows in enumerate(below):
        joins = bool(rows) and rows[0] == k + 1
        if joins:
            ahead = count[k + 1] + int(sizes[k + 1])
            narrow = begin[k + 1] - begin[start] < _NARROW
            joins = count[k] == ahead or (narrow and count[k] >= (1.0 - _ZEROS) * ahead)
        if not joins:
            merged.append((start, k + 1))
            start = k + 1
    owner = np.repeat(np.arange(len(merged)), [stop - first for first, stop in merged])
    fronts = []
    for first, stop in merged:
        # Rows of the last node of a chain hold those of the nodes before it.
        rows = below[stop - 1]
        columns = np.concatenate([np.empty(0, np.int64), *(np.arange(begin[r], begin[r + 1]) for r in rows)])
        parent = int(owner[rows[0]]) if rows else -1
        fronts.append(_Front(int(begin[first]), int(begin[stop]), columns, parent))
    return fronts


def _factor(A: Any) -> Any:
    """L D L^T of a symmetric matrix in its own order, without pivoting."""
    return splu(A.tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


class SparseInverse:
    """G: A^-1 of a sparse A (n, n) of unit diagonal, with ``held`` columns taken out and zero in G.

    ``node`` (n,) says which columns stand together; ``rank``, if given, in which order the nodes make a
    band, which is then dissected.

    Raises IndefiniteError where A has a negative eigenvalue, and DegenerateError where more than the held
    columns is singular to rounding.
    """

    def __init__(self, A: Any, node: Index, held: Index, *, rank: Index | None = None) -> None:
        self.n = A.shape[0]
        keep = np.setdiff1d(np.arange(self.n), held)
        coo = A.tocoo()
        free = np.ones(self.n, dtype=bool)
        free[held] = False
        entries = free[coo.row] & free[coo.col]
        row, column, data = coo.row[entries], coo.col[entries], coo.data[entries]
        kept, node_of = np.unique(node[keep], return_inverse=True)
        numbered = np.full(self.n, -1, dtype=np.int64)
        numbered[keep] = node_of
        pairs = node_pairs(numbered[row], numbered[column])
        if rank is None:
            order = _sparse_order(*pairs, len(kept))
        else:
            order = dissected(*pairs, np.argsort(np.argsort(rank[kept])))
        nodes, self._below = _eliminated(*pairs, order)
        self._sizes = np.bincount(node_of)[nodes]
        self.order = keep[np.argsort(np.argsort(nodes)[node_of], kind="stable")]
        """Columns of the whole in elimination order."""
        self.place = np.full(self.n, -1, dtype=np.int64)
        self.place[self.order] = np.arange(len(keep))
        A = sparse.csc_array((data, (self.place[row], self.place[column])), (len(keep), len(keep)))
        try:
            self._lu = _factor(A)
        except RuntimeError as error:
            raise DegenerateError("more is unobservable than the gauge: H is exactly singular") from error
        self.pivots = self._lu.U.diagonal()
        if np.any(self.pivots <= 0.0):
            # Of a singular matrix the pivots after the first zero are rounding errors: lift it from zero.
            lifted = _factor(A + _LIFT * rounding(self.n) * sparse.eye_array(len(keep)))
            pivots = lifted.U.diagonal()
            if np.any(pivots <= 0.0):
                worst = int(self.order[np.argsort(lifted.perm_c)[np.argmin(pivots)]])
                raise IndefiniteError(
                    f"H is not positive semidefinite: a pivot of {pivots.min():.0e} of its diagonal at column"
                    f" {worst}. It is no sum of squares, or lost digits"
                )
            raise DegenerateError("more is unobservable than the gauge: H is singular to rounding")
        self.size = largest_of_inverse(self._lu.solve, self.order, self.n)
        """Largest eigenvalue of G."""
        self._panels: dict[int, Array] = {}
        self._selected: dict[int, Array] = {}

    @property
    def log_det(self) -> float:
        """log det of A without the held columns."""
        return float(np.sum(np.log(self.pivots)))

    def times(self, B: Array) -> Array:
        """G B of columns (n, c)."""
        out = np.zeros_like(B)
        out[self.order] = self._lu.solve(np.ascontiguousarray(B[self.order]))
        return out

    def across(self, a: Index, b: Index) -> Array:
        """(len(a), len(b)) entries of G, from the fronts between these columns and the last one.

        With X = D^-1/2 L^-1 E for unit columns E, G is X^T X, and X is zero elsewhere.
        """
        columns, number = np.unique(np.concatenate([a, b]), return_inverse=True)
        at = self.place[columns]
        free = np.flatnonzero(at >= 0)
        X = np.zeros((len(self.order), len(columns)))
        X[at[free], free] = 1.0
        G = np.zeros((len(columns), len(columns)))
        for k in self._path(self._owner[at[free]]):
            front, panel = self._fronts[k], self._panel(k)
            size = front.stop - front.start
            x = dtrsm(1.0, panel[:size], X[front.start : front.stop], lower=1)
            X[front.below] -= panel[size:] @ x
            G += x.T @ x
        return G[number[: len(a), None], number[len(a) :]]

    def blocks(self, rows: Index) -> Array:
        """(m, c, c) entries of G over m sets of columns (m, c); what the fronts lack is solved for."""
        m, c = rows.shape
        out = np.zeros((m, c, c))
        where = self.place[rows]
        owner = np.where(where < 0, -1, self._owner[where])
        self._select(owner[owner >= 0])
        inside = (owner == owner[:, :1]).all(axis=1) & (owner[:, 0] >= 0)
        missing = []
        by_front = np.flatnonzero(inside)[np.argsort(owner[inside, 0], kind="stable")]
        for some in (
            np.split(by_front, np.flatnonzero(np.diff(owner[by_front, 0])) + 1) if len(by_front) else []
        ):
            front = int(owner[some[0], 0])
            spot = where[some] - self._fronts[front].start
            out[some] = self._selected[front][spot[:, :, None], spot[:, None, :]]
        for k in np.flatnonzero(~inside & (where >= 0).any(axis=1)):
            there = np.flatnonzero(where[k] >= 0)
            block = self._looked_up(where[k, there])
            if block is not None:
                out[k][np.ix_(there, there)] = block
            else:
                missing.append(k)
        for some in np.array_split(missing, 1 + len(missing) * c // _AT_ONCE) if missing else []:
            columns, inverse = np.unique(rows[some], return_inverse=True)
            G = self.across(columns, columns)
            inverse = inverse.reshape(len(some), c)
            out[some] = G[inverse[:, :, None], inverse[:, None, :]]
        return 0.5 * (out + out.swapaxes(1, 2))

    def _looked_up(self, at: Index) -> Array | None:
        """Entries of the inverse over places ``at``, or None where the fronts lack some."""
        out = np.zeros((len(at), len(at)))
        owner = self._owner[at]
        for number in np.unique(owner):
            front = self._fronts[number]
            mine, later = np.flatnonzero(owner == number), np.flatnonzero(at >= front.start)
            spot = np.searchsorted(front.rows, at[later])
            spot[spot == len(front.rows)] = 0
            if not np.array_equal(front.rows[spot], at[later]):
                return None
            part = self._selected[number][spot[:, None], at[mine] - front.start]
            out[later[:, None], mine], out[mine[:, None], later] = part, part.T
        return out

    @cached_property
    def _fronts(self) -> list[_Front]:
        return _fronts(self._below, self._sizes)

    @cached_property
    def _owner(self) -> Index:
        widths = [front.stop - front.start for front in self._fronts]
        return np.repeat(np.arange(len(widths)), widths)

    @cached_property
    def _L(self) -> Any:
        """L D^1/2 in elimination order, compressed columns."""
        L = self._lu.L[self._lu.perm_c][:, self._lu.perm_c].tocsc()
        L.data *= np.repeat(np.sqrt(self.pivots[self._lu.perm_c]), np.diff(L.indptr))
        return L

    def _panel(self, number: int) -> Array:
        """Columns of L D^1/2 of a front over its rows."""
        if number not in self._panels:
            front, L = self._fronts[number], self._L
            begin = L.indptr[front.start : front.stop + 1]
            rows = L.indices[begin[0] : begin[-1]]
            spot = np.where(
                rows < front.stop,
                rows - front.start,
                front.stop - front.start + np.searchsorted(front.below, rows),
            )
            panel = np.zeros((len(front.rows), front.stop - front.start), order="F")
            panel[spot, np.repeat(np.arange(len(begin) - 1), begin[1:] - begin[:-1])] = L.data[
                begin[0] : begin[-1]
            ]
            self._panels[number] = panel
        return self._panels[number]

    def _path(self, fronts: Index) -> list[int]:
        """Some fronts and all that they lead to, in elimination order."""
        path: set[int] = set()
        for front in np.unique(fronts).tolist():
            while front >= 0 and front not in path:
                path.add(front)
                front = self._fronts[front].parent
        return sorted(path)

    def _select(self, fronts: Index) -> None:
        """Fill in Z_FJ, columns over all rows, of some fronts and of those that they lead to."""
        path = self._path(fronts)
        if all(number in self._selected for number in path):
            return
        # The whole of a front, for as long as others below it need it.
        whole: dict[int, Array] = {}
        children = Counter(self._fronts[number].parent for number in path)
        for number in reversed(path):
            front, panel = self._fronts[number], self._panel(number)
            size = front.stop - front.start
            inverse, _ = lapack.dpotri(panel[:size], lower=1)
            inverse = inverse + inverse.T  # its upper triangle is zero
            inverse.flat[:: size + 1] *= 0.5
            columns = np.empty(panel.shape)
            Z_BB: Array = np.empty((0, 0))
            if len(panel) > size:
                spot = np.searchsorted(self._fronts[front.parent].rows, front.below)
                Z_BB = whole[front.parent][spot[:, None], spot]
                children[front.parent] -= 1
                if not children[front.parent]:
                    del whole[front.parent]
                Y = dtrsm(1.0, panel[:size], panel[size:], side=1, lower=1)
                columns[size:] = -Z_BB @ Y
                inverse -= columns[size:].T @ Y
            columns[:size] = 0.5 * (inverse + inverse.T)
            self._selected[number] = columns
            if children[number]:
                whole[number] = np.block([[columns[:size], columns[size:].T], [columns[size:], Z_BB]])
