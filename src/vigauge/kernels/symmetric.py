"""Symmetric matrices: unpacked from LAPACK's triangle, updated in low rank, inverted on a band."""

from __future__ import annotations

import numpy as np

from ..so3 import Array
from .compiled import kernel
from .visual import Index


@kernel
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
def subtract_outer(G: Array, A: Array, W: Array, out: Array) -> None:
    """out = G - A W^T - W A^T for (n, k) A and W; exactly symmetric, from the lower triangle of G."""
    n, k = A.shape
    for i in range(n):
        for j in range(i + 1):
            value = G[i, j]
            for c in range(k):
                value -= A[i, c] * W[j, c] + W[i, c] * A[j, c]
            out[i, j] = value
            out[j, i] = value


@kernel
def selected_inverse(factor: Array, out: Array) -> None:
    """Entries of (L L^T)^-1 inside the band of L, both as LAPACK's lower band (b + 1, n).

    Takahashi's recurrence from the last column back: a column of the inverse needs only the
    later ones, inside the band.
    """
    width, n = factor.shape
    column = np.empty(width)
    for j in range(n - 1, -1, -1):
        below = min(width - 1, n - 1 - j)
        for i in range(below + 1):
            column[i] = 0.0
        for k in range(1, below + 1):
            value = factor[k, j]
            # Column j + k of the inverse, and by symmetry its row.
            row = out[0, j + k] * value
            for i in range(k + 1, below + 1):
                entry = out[i - k, j + k]
                column[i] -= entry * value
                row += entry * factor[i, j]
            column[k] -= row
        pivot = 1.0 / factor[0, j]
        diagonal = pivot
        for i in range(1, below + 1):
            column[i] *= pivot
            diagonal -= column[i] * factor[i, j]
            out[i, j] = column[i]
        out[0, j] = diagonal * pivot
