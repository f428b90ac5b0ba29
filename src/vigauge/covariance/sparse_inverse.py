"""Chosen blocks of the inverse of a large sparse matrix, without the inverse.

SuperLU factorises A = L D L^T in an order that keeps L sparse. Columns of one keyframe or point stay
together (a node); nodes with alike columns of L are merged (a front). With J the columns of a front, B the
rows below that its columns of L reach, and Y = L_BJ L_JJ^-1,

    Z_BJ = -Z_BB Y,    Z_JJ = (L_JJ D_J L_JJ^T)^-1 - Z_BJ^T Y,

last front first (Takahashi, Fagan and Chin 1973): Z_BB lies inside the front that holds the first row of B.
"""

from __future__ import annotations

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
from .inverses import largest_of_inverse

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


def _node_order(A: Any, node: Index) -> Index:
    """Nodes in an order that keeps the factor sparse: minimum degree on the graph of nodes."""
    count = int(node.max()) + 1
    map_ = sparse.csr_matrix((np.ones(len(node)), (node, np.arange(len(node)))), (count, len(node)))
    pattern = sparse.csr_matrix((np.ones(A.nnz), A.indices, A.indptr), A.shape)
    graph = (map_ @ pattern @ map_.T).tocsc()
    graph.data[:] = -1e-3 / count
    graph.setdiag(1.0)
    lu = splu(graph, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return np.argsort(lu.perm_c)


def _fronts(A: Any, sizes: Index) -> list[_Front]:
    """Fronts of a matrix (n, n) in elimination order, whose nodes have these sizes."""
    begin = np.concatenate([[0], np.cumsum(sizes)])
    node = np.repeat(np.arange(len(sizes)), sizes)
    coo = sparse.tril(A, -1).tocoo()
    pairs = np.unique(node[coo.col] * len(sizes) + node[coo.row])
    above, under = pairs // len(sizes), pairs % len(sizes)
    above, under = above[above != under], under[above != under]
    reach = np.split(under, np.searchsorted(above, np.arange(1, len(sizes))))
    # Symbolic elimination: rows of a node are its own and those of the nodes that it is the first row of.
    below: list[set[int]] = [set(own.tolist()) for own in reach]
    for k, rows in enumerate(below):
        if rows:
            first = min(rows)
            below[first] |= rows
            below[first].discard(first)
        below[k] = rows
    merged: list[tuple[int, int, set[int]]] = []
    start = 0
    for k, rows in enumerate(below):
        joins = k + 1 < len(below) and k + 1 in rows
        if joins:
            ahead = sum(int(sizes[r]) for r in below[k + 1]) + int(sizes[k + 1])
            here = sum(int(sizes[r]) for r in rows)
            narrow = begin[k + 1] - begin[start] < _NARROW
            joins = here == ahead or (narrow and here >= (1.0 - _ZEROS) * ahead)
        if not joins:
            # Rows of the last node of a chain hold those of the nodes before it.
            merged.append((start, k + 1, rows))
            start = k + 1
    owner = np.empty(len(sizes), dtype=np.int64)
    for number, (first, last, _) in enumerate(merged):
        owner[first:last] = number
    fronts = []
    for first, last, rows in merged:
        nodes = np.array(sorted(rows), dtype=np.int64)
        columns = np.concatenate(
            [np.arange(begin[r], begin[r + 1]) for r in nodes] or [np.empty(0, np.int64)]
        )
        parent = int(owner[nodes[0]]) if len(nodes) else -1
        fronts.append(_Front(int(begin[first]), int(begin[last]), columns, parent))
    return fronts


class SparseInverse:
    """G: A^-1 of a sparse A (n, n) of unit diagonal, with ``held`` columns taken out and zero in G.

    ``node`` (n,) says which columns stand together. Raises IndefiniteError where A has a negative
    eigenvalue, and DegenerateError where more than the held columns is singular to rounding.
    """

    def __init__(self, A: Any, node: Index, held: Index) -> None:
        self.n = A.shape[0]
        keep = np.setdiff1d(np.arange(self.n), held)
        A = A.tocsr()[keep][:, keep].tocsc()
        node = np.unique(node[keep], return_inverse=True)[1]
        order = _node_order(A, node)
        rank = np.argsort(order)
        self.order = keep[np.argsort(rank[node], kind="stable")]
        """Columns of the whole in elimination order."""
        self.place = np.full(self.n, -1, dtype=np.int64)
        self.place[self.order] = np.arange(len(self.order))
        within = np.argsort(rank[node], kind="stable")
        self._A = A[within][:, within].tocsc()
        self._sizes = np.bincount(node)[order]
        try:
            self._lu = splu(
                self._A, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
            )
        except RuntimeError as error:
            raise DegenerateError("more is unobservable than the gauge: H is exactly singular") from error
        self.pivots = self._lu.U.diagonal()
        worst = int(np.argmin(self.pivots))
        if self.pivots[worst] < -rounding(self.n):
            column = int(self.order[self._lu.perm_c.argsort()[worst]])
            raise IndefiniteError(
                f"H is not positive semidefinite: a pivot of {self.pivots[worst]:.0e} of its diagonal at"
                f" column {column}. It is no sum of squares, or lost digits"
            )
        self.size = largest_of_inverse(self._lu.solve, self.order, self.n)
        """Largest eigenvalue of G."""

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
        """(len(a), len(b)) entries of G."""
        unit = np.zeros((self.n, len(b)))
        unit[b, np.arange(len(b))] = 1.0
        return self.times(unit)[a]

    def blocks(self, rows: Index) -> Array:
        """(m, c, c) entries of G over m sets of columns (m, c); what the fronts lack is solved for."""
        m, c = rows.shape
        out = np.zeros((m, c, c))
        where = self.place[rows]
        lowest = np.where(where < 0, self.n, where).min(axis=1, initial=self.n)
        missing = []
        for k in np.flatnonzero(lowest < self.n):
            at = where[k]
            there = np.flatnonzero(at >= 0)
            block = self._looked_up(at[there])
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
        return _fronts(self._A, self._sizes)

    @cached_property
    def _owner(self) -> Index:
        widths = [front.stop - front.start for front in self._fronts]
        return np.repeat(np.arange(len(widths)), widths)

    @cached_property
    def _selected(self) -> list[Array]:
        """Z_FJ: columns of each front over all its rows."""
        L = self._lu.L[self._lu.perm_c][:, self._lu.perm_c].tocsc()
        pivots = self.pivots[self._lu.perm_c]
        Z: list[Array] = [np.empty(0)] * len(self._fronts)
        # The whole of a front, for as long as others below it need it.
        whole: dict[int, Array] = {}
        children = np.bincount([f.parent + 1 for f in self._fronts], minlength=len(Z) + 1)[1:]
        local = np.empty(L.shape[0], dtype=np.int64)
        for number in range(len(self._fronts) - 1, -1, -1):
            front = self._fronts[number]
            F, size = front.rows, front.stop - front.start
            local[F] = np.arange(len(F))
            low, high = L.indptr[front.start], L.indptr[front.stop]
            panel = np.zeros((len(F), size), order="F")
            column = np.repeat(np.arange(size), np.diff(L.indptr[front.start : front.stop + 1]))
            panel[local[L.indices[low:high]], column] = L.data[low:high]
            panel *= np.sqrt(pivots[front.start : front.stop])
            inverse, _ = lapack.dpotri(panel[:size], lower=1)
            inverse = np.tril(inverse)
            inverse += np.tril(inverse, -1).T
            columns = np.empty((len(F), size))
            Z_BB: Array = np.empty((0, 0))
            if len(F) > size:
                above = self._fronts[front.parent].rows
                spot = np.searchsorted(above, front.below)
                Z_BB = whole[front.parent][spot[:, None], spot]
                children[front.parent] -= 1
                if not children[front.parent]:
                    del whole[front.parent]
                Y = dtrsm(1.0, panel[:size], panel[size:], side=1, lower=1)
                columns[size:] = -Z_BB @ Y
                inverse -= columns[size:].T @ Y
            columns[:size] = 0.5 * (inverse + inverse.T)
            Z[number] = columns
            if children[number]:
                whole[number] = np.block([[columns[:size], columns[size:].T], [columns[size:], Z_BB]])
        return Z
