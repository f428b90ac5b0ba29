"""Generalised inverses that answer for chosen blocks: dense, banded, of a Schur complement.

All of them are G with H G H = H, asked by columns of H: ``times``, ``across`` and ``blocks``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import scipy.linalg.lapack as lapack
import scipy.sparse as sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee

from ..errors import DegenerateError
from ..gauge.layout import Index
from ..geometry.so3 import Array
from ..sparsity.rounding import rounding
from .banded_inverse import selected_inverse

# Landmarks whose blocks are made at a time.
_AT_ONCE = 512


class Inverse(Protocol):
    """What a covariance asks of G (n, n)."""

    def times(self, B: Array) -> Array:
        """G B of columns (n, c)."""

    def across(self, a: Index, b: Index) -> Array:
        """(len(a), len(b)) entries of G."""

    def blocks(self, rows: Index) -> Array:
        """(m, c, c) entries of G over m sets of columns (m, c)."""


@dataclass(frozen=True, eq=False)
class DenseInverse:
    """G as a matrix."""

    G: Array

    def times(self, B: Array) -> Array:
        return self.G @ B

    def across(self, a: Index, b: Index) -> Array:
        return self.G[a[:, None], b]

    def blocks(self, rows: Index) -> Array:
        return self.G[rows[:, :, None], rows[:, None, :]]


@dataclass(frozen=True, eq=False)
class Scaled:
    """D G D with a diagonal D: back from the unit diagonal to the units of H."""

    inverse: Inverse
    scale: Array

    def times(self, B: Array) -> Array:
        return self.scale[:, None] * self.inverse.times(self.scale[:, None] * B)

    def across(self, a: Index, b: Index) -> Array:
        return self.scale[a][:, None] * self.inverse.across(a, b) * self.scale[b]

    def blocks(self, rows: Index) -> Array:
        size = self.scale[rows]
        return size[:, :, None] * self.inverse.blocks(rows) * size[:, None, :]


def largest_of_inverse(solve: Callable[[Array], Array], order: Index, n: int) -> float:
    """Largest eigenvalue of an inverse, by inverse iteration; ``order`` names the columns solved for.

    Raises DegenerateError where the matrix, of unit diagonal, is singular to rounding.
    """
    X: Array = np.random.default_rng(0).standard_normal((len(order), 4))
    for _ in range(3):
        X = solve(np.linalg.qr(X)[0])
    size = float(np.linalg.norm(X, 2)) if len(order) else 0.0
    if not size * rounding(n) <= 1.0:
        worst = int(order[np.argmax(np.abs(X[:, 0]))])
        raise DegenerateError(
            f"more is unobservable than the gauge: the scaled information is singular"
            f" (below {1.0 / size:.0e}, mostly in column {worst})"
        )
    return size


def node_pairs(row: Index, column: Index) -> tuple[Index, Index]:
    """Pairs of nodes, each once, from those of all entries of a sparse matrix."""
    count = int(row.max(initial=-1)) + 1
    pairs = row + count * column.astype(np.int64)
    # Entries of one pair often follow each other: fewer to sort.
    new = np.append(True, pairs[1:] != pairs[:-1])[: len(pairs)]
    seen = np.unique(pairs[new])
    return seen % count, seen // count


def band_order(A: Any, node: Index, enough: int) -> tuple[Index, Index, int]:
    """Places of nodes, and an order of columns, that make a sparse matrix a band; its half bandwidth.

    Columns of a node stay together, and all stay where they are if that gives a half bandwidth of at most
    ``enough``.
    """
    coo = A.tocoo()
    row, column = node_pairs(node[coo.row], node[coo.col])
    sizes = np.bincount(node)

    def width(rank: Index) -> int:
        start = np.cumsum(np.bincount(rank, sizes))
        first, last = np.minimum(rank[row], rank[column]), np.maximum(rank[row], rank[column])
        return int(np.max(start[last] - start[first] + sizes[np.argsort(rank)][first], initial=1)) - 1

    rank = np.arange(len(sizes))
    reach = width(rank)
    if reach > enough:
        graph = sparse.csr_array((np.ones(len(row)), (row, column)), (len(sizes),) * 2)
        other = np.argsort(reverse_cuthill_mckee(graph, symmetric_mode=True))
        if width(other) < reach:
            rank, reach = other, width(other)
    return rank, np.argsort(rank[node], kind="stable"), reach


@dataclass(frozen=True, eq=False)
class SchurInverse:
    """G of the whole from that of its Schur complement, points eliminated: S = A - B C^-1 B^T.

    ``inverse`` of S (n, n); ``Y`` (3K, n) sparse, C^-1 B^T; ``C_inverse`` (K, 3, 3).
    """

    inverse: Inverse
    Y: Any
    C_inverse: Array

    @cached_property
    def n(self) -> int:
        return int(self.Y.shape[1])

    def times(self, B: Array) -> Array:
        motion, points = B[: self.n], B[self.n :]
        g = self.inverse.times(motion - self.Y.T @ points)
        own = (self.C_inverse @ points.reshape(len(self.C_inverse), 3, -1)).reshape(points.shape)
        return np.concatenate([g, own - self.Y @ g])

    def across(self, a: Index, b: Index) -> Array:
        if a.max(initial=-1) < self.n and b.max(initial=-1) < self.n:
            return self.inverse.across(a, b)
        unit = np.zeros((self.n + self.Y.shape[0], len(b)))
        unit[b, np.arange(len(b))] = 1.0
        return self.times(unit)[a]

    def blocks(self, rows: Index) -> Array:
        if rows.max(initial=-1) < self.n:
            return self.inverse.blocks(rows)
        if rows.min() < self.n or rows.shape[1] != 3:
            return np.array([self.across(row, row) for row in rows])
        out = self.C_inverse[(rows[:, 0] - self.n) // 3].copy()
        for start in range(0, len(rows), _AT_ONCE):
            Y = self.Y[rows[start : start + _AT_ONCE].ravel() - self.n]
            seen = np.unique(Y.indices)
            some = Y[:, seen].toarray()
            G = some @ self.inverse.across(seen, seen)
            m = len(some) // 3
            out[start : start + m] += G.reshape(m, 3, -1) @ some.reshape(m, 3, -1).swapaxes(1, 2)
        return out


class BandInverse:
    """G: A^-1 of a sparse A of unit diagonal that an order makes a band, ``held`` columns taken out.

    ``far`` makes the inverse that is asked for entries outside the band.

    Raises ArithmeticError where the matrix is not positive definite.
    """

    def __init__(self, A: Any, order: Index, width: int, held: Index, far: Callable[[], Inverse]) -> None:
        self._make_far = far
        self.n = A.shape[0]
        self.order = order[~np.isin(order, held)]
        self.place = np.full(self.n, -1, dtype=np.int64)
        self.place[self.order] = np.arange(len(self.order))
        coo = A.tocoo()
        row, column = self.place[coo.row], self.place[coo.col]
        lower = (column >= 0) & (row >= column)
        row, column = row[lower], column[lower]
        band = np.zeros((width + 1, len(self.order)), order="F")
        band[row - column, column] = coo.data[lower]
        self.factor, info = lapack.dpbtrf(band, lower=1, overwrite_ab=1)
        if info:
            raise ArithmeticError(info)

    @property
    def log_det(self) -> float:
        """log det of A without the held columns."""
        return float(2.0 * np.sum(np.log(self.factor[0])))

    def times(self, B: Array) -> Array:
        out = np.zeros_like(B)
        out[self.order] = self.solve(B[self.order])
        return out

    def solve(self, right: Array) -> Array:
        """Solution for right-hand sides (n - held, c) in the band's order."""
        solution: Array = lapack.dpbtrs(self.factor, right, lower=1)[0]
        return solution

    @cached_property
    def _band(self) -> Array:
        return selected_inverse(self.factor)

    @cached_property
    def _far(self) -> Inverse:
        return self._make_far()

    def across(self, a: Index, b: Index) -> Array:
        return self._far.across(a, b)

    def blocks(self, rows: Index) -> Array:
        at = self.place[rows]
        low = np.minimum(at[:, :, None], at[:, None, :])
        offset = np.maximum(at[:, :, None], at[:, None, :]) - low
        far = (offset >= len(self.factor)) & (low >= 0)
        G = self._band[np.where(far, 0, offset) * (low >= 0), low]
        out = np.where(low >= 0, G, 0.0)
        for k in np.flatnonzero(far.any(axis=(1, 2))):
            out[k] = self.across(rows[k], rows[k])
        return out
