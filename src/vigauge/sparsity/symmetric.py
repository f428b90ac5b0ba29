"""The gate for large sparse matrices that must be symmetric."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays import ASYMMETRY, HELD, asymmetric, sparse_reals
from ..errors import DataError
from ..kernels.symmetric import largest_asymmetry


def sparse_symmetric(what: str, value: Any, n: int) -> Any:
    """``value`` of scipy.sparse as :func:`..arrays.symmetric` takes a dense one, in compressed columns."""
    matrix = sparse_reals(what, value, (n, n))
    entries = matrix.indptr, matrix.indices, matrix.data
    diagonal = np.zeros(n)
    excess, *at = largest_asymmetry(*entries, diagonal, 0.0, diagonal)
    if diagonal.min(initial=0.0) < 0.0:
        row = int(np.argmin(diagonal))
        rule = "must have a diagonal without negative entries"
        raise DataError(what, rule, row=row, value=float(diagonal[row]))
    if excess > 0.0:
        size = np.sqrt(np.maximum(diagonal, HELD * float(diagonal.max(initial=0.0))))
        excess, *at = largest_asymmetry(*entries, size, ASYMMETRY, diagonal)
    if excess > 0.0:
        raise asymmetric(what, tuple(at), float(matrix[at[0], at[1]]), float(matrix[at[1], at[0]]))
    return matrix
