"""BLAS for kernels: SciPy's own, through the addresses that it exports to compiled code.

A call from Python costs as much as a product of a few dozen landmarks; from here, next to nothing.
"""

from __future__ import annotations

import importlib.util
import sys
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

import llvmlite.binding
import numpy as np
import scipy
from numba import types
from numba.extending import get_cython_function_address
from numpy.typing import NDArray

from ..geometry.so3 import Array
from .compiled import part

INT = types.CPointer(types.int32)
CHAR = types.CPointer(types.uint8)
DOUBLE = types.CPointer(types.float64)
# Scratch for the sizes and strides that BLAS and LAPACK take by address.
Sizes = NDArray[np.int32]


def name_symbol(module: str, function: str) -> str:
    """The name by which kernels know a function of ``scipy.linalg.cython_blas`` or ``cython_lapack``.

    Compiled code on disk refers to the name, so every process gives it its address on import. The extension
    alone is loaded where it can be found: importing the whole of scipy.linalg takes longer than a solve.
    """
    full = f"scipy.linalg.{module}"
    spec = PathFinder.find_spec(full, [str(Path(scipy.__file__).with_name("linalg"))])
    if full not in sys.modules and spec is not None and spec.loader is not None:
        spec.loader.exec_module(importlib.util.module_from_spec(spec))
    llvmlite.binding.add_symbol(f"vigauge_{function}", get_cython_function_address(full, function))
    return f"vigauge_{function}"


_dgemm: Any = types.ExternalFunction(
    name_symbol("cython_blas", "dgemm"),
    types.void(CHAR, CHAR, INT, INT, INT, DOUBLE, DOUBLE, INT, DOUBLE, INT, DOUBLE, DOUBLE, INT),
)

_dtrsm: Any = types.ExternalFunction(
    name_symbol("cython_blas", "dtrsm"),
    types.void(CHAR, CHAR, CHAR, CHAR, INT, INT, DOUBLE, DOUBLE, INT, DOUBLE, INT),
)

_PLAIN = np.frombuffer(b"N", dtype=np.uint8)
_TRANSPOSED = np.frombuffer(b"T", dtype=np.uint8)
_FORMS = np.frombuffer(b"NT", dtype=np.uint8)
_RIGHT = np.frombuffer(b"R", dtype=np.uint8)
_LOWER = np.frombuffer(b"L", dtype=np.uint8)
_ONE = np.ones(1)
# The factors -1, 0 and 1.
_FACTORS = np.array([-1.0, 0.0, 1.0])

# Width of the panels that a triangle is made of, a vector of eight. They cost few products more than
# the triangle has, and half the time of dsyrk where BLAS has kernels for small matrices (measured,
# AVX-512); elsewhere a tenth more.
_PANEL = 8


@part
def multiply(
    A: Array,
    stride_A: int,
    transposed_A: bool,
    B: Array,
    stride_B: int,
    transposed_B: bool,
    m: int,
    n: int,
    k: int,
    sign: int,
    keep: int,
    C: Array,
    stride_C: int,
    size: Sizes,
) -> None:
    """C <- sign A B + keep C of flat matrices stored column by column, of which C is (m, n).

    A, B may be transposed, k is what they share; sign and keep are -1, 0 or 1. ``size`` (6,) is scratch.
    """
    size[0], size[1], size[2], size[3], size[4], size[5] = m, n, k, stride_A, stride_B, stride_C
    _dgemm(
        _FORMS[int(transposed_A) :].ctypes,
        _FORMS[int(transposed_B) :].ctypes,
        size.ctypes,
        size[1:].ctypes,
        size[2:].ctypes,
        _FACTORS[sign + 1 :].ctypes,
        A.ctypes,
        size[3:].ctypes,
        B.ctypes,
        size[4:].ctypes,
        _FACTORS[keep + 1 :].ctypes,
        C.ctypes,
        size[5:].ctypes,
    )


@part
def solve_right(
    L: Array,
    stride_L: int,
    transposed: bool,
    m: int,
    n: int,
    B: Array,
    stride_B: int,
    size: Sizes,
) -> None:
    """B <- B L^-1, or B L^-T, for L (n, n) lower and B (m, n), both flat and column by column.

    ``size`` (4,) is scratch.
    """
    size[0], size[1], size[2], size[3] = m, n, stride_L, stride_B
    _dtrsm(
        _RIGHT.ctypes,
        _LOWER.ctypes,
        _FORMS[int(transposed) :].ctypes,
        _PLAIN.ctypes,
        size.ctypes,
        size[1:].ctypes,
        _ONE.ctypes,
        L.ctypes,
        size[2:].ctypes,
        B.ctypes,
        size[3:].ctypes,
    )


@part
def add_gram(A: Array, k: int, n: int, first: int, end: int, out: Array, size: Sizes) -> None:
    """Add A_b^T A_b, A_b the columns first..end of A (k, n), to ``out`` (n, n); both flat, row by row.

    At least the entries with column >= row are added to. ``size`` (4,) is scratch.
    """
    size[2], size[3] = k, n
    # The odd columns first, so that all other panels have whole vectors in both directions.
    c, width = first, (end - first) % _PANEL or _PANEL
    while c < end:
        size[0], size[1] = end - c, width
        _dgemm(
            _PLAIN.ctypes,
            _TRANSPOSED.ctypes,
            size.ctypes,
            size[1:].ctypes,
            size[2:].ctypes,
            _ONE.ctypes,
            A[c:].ctypes,
            size[3:].ctypes,
            A[c:].ctypes,
            size[3:].ctypes,
            _ONE.ctypes,
            out[c * (n + 1) :].ctypes,
            size[3:].ctypes,
        )
        c, width = c + width, _PANEL
