"""Chosen blocks of the inverse of a large sparse matrix, without the inverse.

Columns of one keyframe or point stay together (a node). SuperLU orders the nodes so that the factor stays
sparse; the kernels do the rest, front by front (:mod:`vigauge.kernels.multifrontal`).
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

from ..errors import DegenerateError, IndefiniteError
from ..gauge.layout import Index
from ..geometry.so3 import Array
from ..kernels import elimination, multifrontal
from ..sparsity.rounding import rounding

# What a singular matrix is lifted by, in units of its rounding, to see whether it has negative eigenvalues.
_LIFT = 1e3
# Right-hand sides that are solved at a time.
_AT_ONCE = 64


def _sparse_order(start: Index, neighbour: Index) -> Index:
    """Nodes of a graph in compressed columns, in an order that keeps the factor sparse: minimum degree."""
    pair = elimination.pairs(start, neighbour)
    row, column = pair[neighbour], np.repeat(pair, np.diff(start))
    graph = sparse.csc_array((np.where(row == column, 1.0, -1e-3 / len(neighbour)), (row, column)))
    lu = splu(graph, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return np.argsort(lu.perm_c[pair], kind="stable")


class SparseInverse:
    """G: A^-1 of a sparse A = D H D of unit diagonal, with ``held`` columns taken out and zero in G.

    H (n, n) in compressed columns, ``scale`` (n,) the diagonal of D; ``node`` (n,) says which columns stand
    together.

    Raises IndefiniteError where A has a negative eigenvalue, and DegenerateError where more than the held
    columns is singular to rounding.
    """

    def __init__(self, H: Any, scale: Array, node: Index, held: Index) -> None:
        self.n = H.shape[0]
        free = np.ones(self.n, dtype=bool)
        free[held] = False
        sizes = np.bincount(node[free])
        node = np.where(free, (np.cumsum(sizes > 0) - 1)[node], -1)
        sizes = sizes[sizes > 0]
        columns = np.argsort(node, kind="stable")[len(held) :]
        first = np.concatenate([[0], np.cumsum(sizes)])
        graph = elimination.neighbours(H.indptr, H.indices, node, columns, first)
        nodes, begin, reach = elimination.eliminate(*graph, _sparse_order(*graph))
        start = np.concatenate([[0], np.cumsum(sizes[nodes])])
        self.order = columns[np.repeat(first[nodes] - start[:-1], sizes[nodes]) + np.arange(start[-1])]
        """Columns of the whole in elimination order."""
        self.place = np.full(self.n, -1, dtype=np.int64)
        self.place[self.order] = np.arange(len(self.order))
        self._fronts = elimination.merge(begin, reach, start)
        self._owner = np.repeat(np.arange(len(self._fronts.parent)), np.diff(self._fronts.start))
        self._panels = np.empty(self._fronts.panel[-1])
        if self._factorise(H, scale, 0.0)[0] >= 0:
            # Of a singular matrix the pivots after the first zero are rounding errors: lift it from zero.
            place, pivot = self._factorise(H, scale, _LIFT * rounding(self.n))
            if place >= 0:
                at = int(self.order[place])
                raise IndefiniteError(
                    f"H is not positive semidefinite: a pivot of {pivot:.0e} of its diagonal at column {at}."
                    " It is no sum of squares, or lost digits",
                    parameters=(at,),
                )
            raise DegenerateError("more is unobservable than the gauge: H is singular to rounding")
        if not self.below(1.0 / rounding(self.n)):
            raise DegenerateError(
                f"more is unobservable than the gauge: the scaled information is singular"
                f" (below {1.0 / self._largest[0]:.0e}, mostly in column {self._largest[1]})",
                parameters=(self._largest[1],),
            )

    def _factorise(self, H: Any, scale: Array, lift: float) -> tuple[int, float]:
        return multifrontal.factorise(
            self._fronts, H.indptr, H.indices, H.data, scale, self.order, self.place, lift, self._panels
        )

    def below(self, limit: float) -> bool:
        """Whether no eigenvalue of G exceeds ``limit``: as a rule the trace, which is no less, tells."""
        trace = float(np.sum(self._selected[self._diagonal]))
        return 0.0 <= trace <= limit or self._largest[0] <= limit

    @cached_property
    def _largest(self) -> tuple[float, int]:
        """Largest eigenvalue of G, by inverse iteration, and the column that it is mostly in."""
        X, every = np.zeros((len(self.order), 4)), np.arange(len(self.order))
        # Random, and orthogonal to begin with: each row has one entry.
        X[every, every % 4] = np.random.default_rng(0).standard_normal(len(X))
        multifrontal.solve(self._fronts, self._panels, X)
        for _ in range(2):
            X = np.linalg.qr(X)[0]
            multifrontal.solve(self._fronts, self._panels, X)
        return float(np.linalg.norm(X, 2)), int(self.order[np.argmax(np.abs(X[:, 0]))])

    @cached_property
    def _diagonal(self) -> Index:
        """Where the panels have their diagonal entries."""
        start, panel = self._fronts.start, self._fronts.panel
        size, rows = np.diff(start), np.diff(panel) // np.maximum(np.diff(start), 1)
        within = np.arange(len(self.order)) - np.repeat(start[:-1], size)
        return np.repeat(panel[:-1], size) + within * (np.repeat(rows, size) + 1)

    @property
    def log_det(self) -> float:
        """log det of A without the held columns."""
        return float(2.0 * np.sum(np.log(self._panels[self._diagonal])))

    def times(self, B: Array) -> Array:
        """G B of columns (n, c)."""
        X = np.ascontiguousarray(B[self.order])
        multifrontal.solve(self._fronts, self._panels, X)
        out = np.zeros_like(B)
        out[self.order] = X
        return out

    def across(self, a: Index, b: Index) -> Array:
        """(len(a), len(b)) entries of G, from the fronts between these columns and the last one.

        With X = L^-1 E for unit columns E, G is X^T X, and X is zero elsewhere.
        """
        columns, number = np.unique(np.concatenate([a, b]), return_inverse=True)
        at = self.place[columns]
        free = np.flatnonzero(at >= 0)
        X = np.zeros((len(self.order), len(columns)))
        X[at[free], free] = 1.0
        G = np.zeros((len(columns), len(columns)))
        path: set[int] = set()
        for front in np.unique(self._owner[at[free]]).tolist():
            while front >= 0 and front not in path:
                path.add(front)
                front = int(self._fronts.parent[front])
        multifrontal.gram(self._fronts, self._panels, np.array(sorted(path), dtype=np.int64), X, G)
        return G[number[: len(a), None], number[len(a) :]]

    def blocks(self, rows: Index) -> Array:
        """(m, c, c) entries of G over m sets of columns (m, c); what the fronts lack is solved for."""
        m, c = rows.shape
        out = np.empty((m, c, c))
        missing = multifrontal.blocks(self._fronts, self._selected, self._owner, self.place[rows], out)
        for some in np.array_split(missing, 1 + len(missing) * c // _AT_ONCE) if len(missing) else []:
            columns, inverse = np.unique(rows[some], return_inverse=True)
            G = self.across(columns, columns)
            inverse = inverse.reshape(len(some), c)
            out[some] = G[inverse[:, :, None], inverse[:, None, :]]
        return out

    @cached_property
    def _selected(self) -> Array:
        """Entries of G where the factor has some."""
        out = np.empty_like(self._panels)
        multifrontal.select(self._fronts, self._panels, out)
        return out
