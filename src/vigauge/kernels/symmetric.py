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
def subtract_outer(G: Array, A: Array, W: Array) -> None:
    """G <- G - A W^T - W A^T for (n, 4) A and W; exactly symmetric, from the lower triangle of G."""
    for i in range(G.shape[0]):
        a0, a1, a2, a3 = A[i, 0], A[i, 1], A[i, 2], A[i, 3]
        w0, w1, w2, w3 = W[i, 0], W[i, 1], W[i, 2], W[i, 3]
        for j in range(i + 1):
            value = G[i, j] - (a0 * W[j, 0] + a1 * W[j, 1] + a2 * W[j, 2] + a3 * W[j, 3])
            value -= w0 * A[j, 0] + w1 * A[j, 1] + w2 * A[j, 2] + w3 * A[j, 3]
            G[i, j] = value
            G[j, i] = value


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
