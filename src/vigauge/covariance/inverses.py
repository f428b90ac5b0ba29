"""Generalised inverses that answer for chosen blocks: dense, scaled, of a Schur complement.

All of them are G with H G H = H, asked by columns of H: ``times``, ``across`` and ``blocks``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from ..gauge.layout import Index
from ..geometry.so3 import Array

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
        size, out = self.scale[rows], self.inverse.blocks(rows)
        out *= size[:, :, None]
        out *= size[:, None, :]
        return out


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
