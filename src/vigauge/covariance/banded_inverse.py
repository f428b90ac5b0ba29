"""The inverse of a banded matrix from its Cholesky factor, whole or inside the band.

Z = (L L^T)^-1 satisfies Z L = L^-T, upper triangular. By blocks of columns j, with B the rows below
the diagonal block that the band reaches and Y = L_Bj L_jj^-1,

    Z_ij = -Z_iB Y  for rows i below,    Z_jj = (L_jj L_jj^T)^-1 - Z_jB Y,

so a block of the inverse needs only the later ones (Takahashi, Fagan and Chin 1973): time grows with
n^2 b for the whole of it and with n b^2 for the band, and all of it is products of matrices.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.linalg.lapack as lapack
from scipy.linalg.blas import dtrsm

from ..geometry.so3 import Array

# Columns of a block (measured): wide enough for the products, narrow against the usual band.
_BLOCK = 54


def _blocks(factor: Array) -> Iterator[tuple[slice, slice, Array, Array]]:
    """Blocks of columns of L, last first: the block, the rows B, (L_jj L_jj^T)^-1, and Y (len(B), b).

    ``factor`` L in LAPACK's lower band form (b + 1, n).
    """
    width, n = factor.shape
    for start in range((n - 1) // _BLOCK * _BLOCK, -1, -_BLOCK):
        stop = min(start + _BLOCK, n)
        below = min(stop + width - 1, n)
        # Columns of the band one beside the other, each shifted by one: a block of L read by strides.
        size = stop - start
        column = np.zeros((size, size + below - stop + width))
        reach = min(width, n - start)
        shifted = np.lib.stride_tricks.as_strided(
            column, (size, reach), ((column.shape[1] + 1) * column.itemsize, column.itemsize)
        )
        shifted[:] = factor[:reach, start:stop].T
        L = column[:, : below - start].T
        inverse, _ = lapack.dpotri(L[:size], lower=1)
        inverse = inverse + inverse.T  # its upper triangle is zero, as that of L
        inverse.flat[:: size + 1] *= 0.5
        Y = dtrsm(1.0, L[:size], L[size:], side=1, lower=1) if below > stop else L[size:]
        yield slice(start, stop), slice(stop, below), inverse, Y


def banded_inverse(factor: Array) -> Array:
    """(n, n) inverse of L L^T, from L in LAPACK's lower band form (b + 1, n)."""
    n = factor.shape[1]
    Z = np.zeros((n, n))
    for block, below, inverse, Y in _blocks(factor):
        if Y.size:
            column = Z[block.stop :, below] @ Y
            np.negative(column, out=column)
            Z[block.stop :, block] = column
            Z[block, block.stop :] = column.T
            inverse -= column[: len(Y)].T @ Y
        Z[block, block] = 0.5 * (inverse + inverse.T)
    return Z


def selected_inverse(factor: Array) -> Array:
    """Entries of (L L^T)^-1 inside the band of L, both in LAPACK's lower band form (b + 1, n)."""
    width, n = factor.shape
    out = np.zeros((width, n))
    # Z_BB, the window of the inverse that the next block needs.
    window = np.zeros((0, 0))
    for block, below, inverse, Y in _blocks(factor):
        size, reach = block.stop - block.start, below.stop - below.start
        end = size + reach
        whole = np.zeros((size + width - 1, end))
        if reach:
            column = window[:reach, :reach] @ Y
            np.negative(column, out=column)
            whole[size:end, :size], whole[:size, size:] = column, column.T
            inverse -= column.T @ Y
        whole[:size, :size] = 0.5 * (inverse + inverse.T)
        whole[size:end, size:] = window[:reach, :reach]
        # Each column from its diagonal down.
        step = whole.itemsize
        diagonals = np.lib.stride_tricks.as_strided(whole, (width, size), (end * step, (end + 1) * step))
        out[:, block] = diagonals
        window = whole[: min(width - 1, end), : width - 1]
    return out
