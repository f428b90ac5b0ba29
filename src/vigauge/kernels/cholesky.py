"""Cholesky factor of a stored lower triangle, by LAPACK, and the solution of one right-hand side.

Entry (r, c) is ``storage[c * stride + r]``, with r - c up to ``half_bandwidth``: LAPACK's full form where
``stride`` is the size, its band form where ``stride`` is ``half_bandwidth``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import types

from ..geometry.so3 import Array
from .blas import CHAR, DOUBLE, INT, Sizes, name_symbol, solve_right
from .compiled import kernel, part

_dpotrf: Any = types.ExternalFunction(
    name_symbol("cython_lapack", "dpotrf"), types.void(CHAR, INT, DOUBLE, INT, INT)
)
_dpbtrf: Any = types.ExternalFunction(
    name_symbol("cython_lapack", "dpbtrf"), types.void(CHAR, INT, INT, DOUBLE, INT, INT)
)
_dlauum: Any = types.ExternalFunction(
    name_symbol("cython_lapack", "dlauum"), types.void(CHAR, INT, DOUBLE, INT, INT)
)

_dtrsv: Any = types.ExternalFunction(
    name_symbol("cython_blas", "dtrsv"), types.void(CHAR, CHAR, CHAR, INT, DOUBLE, INT, DOUBLE, INT)
)
_dtbsv: Any = types.ExternalFunction(
    name_symbol("cython_blas", "dtbsv"), types.void(CHAR, CHAR, CHAR, INT, INT, DOUBLE, INT, DOUBLE, INT)
)

_LOWER = np.frombuffer(b"L", dtype=np.uint8)
_UPPER = np.frombuffer(b"U", dtype=np.uint8)
_PLAIN = np.frombuffer(b"N", dtype=np.uint8)
_TRANSPOSED = np.frombuffer(b"T", dtype=np.uint8)


@part
def subtract(factor: float, x: Array, out: Array) -> None:
    """out <- out - factor x. Of slices the compiler knows that no index is negative: it uses vectors."""
    for i in range(len(out)):
        out[i] -= factor * x[i]


@part
def subtract_four(
    a: float, A: Array, b: float, B: Array, c: float, C: Array, d: float, D: Array, out: Array
) -> None:
    """As :func:`subtract`, of four at a time."""
    for i in range(len(out)):
        out[i] -= a * A[i] + b * B[i] + c * C[i] + d * D[i]


@part
def factorise_block(A: Array, n: int, stride: int, size: Sizes) -> int:
    """Overwrite a lower triangle (n, n) in full form by its factor; 0, or the pivot that is not positive.

    Pivots count from 1; this one stays where it stands. ``size`` (3,) is scratch.
    """
    size[0], size[1], size[2] = n, stride, 0
    _dpotrf(_LOWER.ctypes, size.ctypes, A.ctypes, size[1:].ctypes, size[2:].ctypes)
    return size[2]


# Panels with more columns are left to LAPACK (measured).
WIDEST_OWN = 40


@part
def factorise_panel(panel: Array, s: int, m: int, stride: int, size: Sizes) -> int:
    """Overwrite the s columns of a panel of m rows by columns of the factor; 0, or the pivot as above.

    The first s rows are a lower triangle; ``size`` (4,) is scratch. Four columns at a time are subtracted,
    which takes less than LAPACK's calls where columns are few.
    """
    if s > WIDEST_OWN:
        wrong = factorise_block(panel, s, stride, size)
        if not wrong and m > s:
            solve_right(panel, stride, True, m - s, s, panel[s:], stride, size)
        return wrong
    for c in range(s):
        column = panel[c * stride + c : c * stride + m]
        whole = c // 4 * 4
        for b in range(0, whole, 4):
            A, B = panel[b * stride + c :], panel[(b + 1) * stride + c :]
            C, D = panel[(b + 2) * stride + c :], panel[(b + 3) * stride + c :]
            subtract_four(A[0], A, B[0], B, C[0], C, D[0], D, column)
        for b in range(whole, c):
            before = panel[b * stride + c : b * stride + m]
            subtract(before[0], before, column)
        if not column[0] > 0.0:
            return c + 1
        scale = 1.0 / math.sqrt(column[0])
        for t in range(len(column)):
            column[t] *= scale
    return 0


@kernel
def factorise(storage: Array, size: int, stride: int, half_bandwidth: int) -> bool:
    """Overwrite the triangle by its factor; whether it is positive definite."""
    n = np.empty(4, dtype=np.int32)
    if stride != half_bandwidth:
        return factorise_block(storage, size, stride, n) == 0
    n[0], n[1], n[2], n[3] = size, half_bandwidth, stride + 1, 0
    _dpbtrf(_LOWER.ctypes, n.ctypes, n[1:].ctypes, storage.ctypes, n[2:].ctypes, n[3:].ctypes)
    return n[3] == 0


@part
def solve_block(L: Array, n: int, stride: int, x: Array, size: Sizes) -> None:
    """Replace a right-hand side (n,) by the solution, by a factor in full form; ``size`` (3,) is scratch."""
    size[0], size[1], size[2] = n, stride, 1
    N, lda, one = size.ctypes, size[1:].ctypes, size[2:].ctypes
    _dtrsv(_LOWER.ctypes, _PLAIN.ctypes, _PLAIN.ctypes, N, L.ctypes, lda, x.ctypes, one)
    _dtrsv(_LOWER.ctypes, _TRANSPOSED.ctypes, _PLAIN.ctypes, N, L.ctypes, lda, x.ctypes, one)


@kernel
def solve(factor: Array, stride: int, half_bandwidth: int, x: Array) -> None:
    """Replace a right-hand side by the solution."""
    n = np.empty(4, dtype=np.int32)
    if stride != half_bandwidth:
        solve_block(factor, len(x), stride, x, n)
        return
    n[0], n[1], n[2], n[3] = len(x), half_bandwidth, stride + 1, 1
    N, k, lda, one, L = n.ctypes, n[1:].ctypes, n[2:].ctypes, n[3:].ctypes, factor.ctypes
    _dtbsv(_LOWER.ctypes, _PLAIN.ctypes, _PLAIN.ctypes, N, k, L, lda, x.ctypes, one)
    _dtbsv(_LOWER.ctypes, _TRANSPOSED.ctypes, _PLAIN.ctypes, N, k, L, lda, x.ctypes, one)


@kernel
def inverse(factor: Array, out: Array) -> None:
    """Lower triangle of the inverse into ``out`` (n, n), from L^T (n, n): rows as LAPACK stores columns of L.

    The rows of L^-1 are found one after another, four of those before at a time: LAPACK's dtrtri takes
    three times as long for a matrix of ten keyframes, and less for one of a hundred (measured).
    """
    n = len(factor)
    row = np.empty(n)
    out[:] = 0.0
    for r in range(n):
        row[:r] = 0.0
        whole = r // 4 * 4
        for k in range(0, whole, 4):
            a, b, c, d = factor[k, r], factor[k + 1, r], factor[k + 2, r], factor[k + 3, r]
            A, B, C, D = out[k], out[k + 1], out[k + 2], out[k + 3]
            for j in range(k + 4):
                row[j] -= a * A[j] + b * B[j] + c * C[j] + d * D[j]
        for k in range(whole, r):
            a, A = factor[k, r], out[k]
            for j in range(k + 1):
                row[j] -= a * A[j]
        d = 1.0 / factor[r, r]
        for j in range(r):
            out[r, j] = row[j] * d
        out[r, r] = d
    size = np.empty(2, dtype=np.int32)
    size[0], size[1] = n, 0
    _dlauum(_UPPER.ctypes, size.ctypes, out.ctypes, size.ctypes, size[1:].ctypes)
