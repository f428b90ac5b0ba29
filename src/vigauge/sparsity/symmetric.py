"""The gate for large sparse matrices that must be symmetric."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays import ASYMMETRY, HELD, asymmetric, sparse_reals
from ..errors import DataError
from ..geometry.so3 import Array
from ..kernels.symmetric import exactly_symmetric, largest_asymmetry


def sparse_symmetric(what: str, value: Any, n: int) -> tuple[Any, Array]:
    """The matrix in compressed columns and its diagonal; refuses what :func:`..arrays.symmetric` refuses.

    What comes out is symmetric to the last bit, and stored so: an entry that only one triangle has would lead
    the elimination astray.
    """
    matrix = sparse_reals(what, value, (n, n))
    entries = matrix.indptr, matrix.indices, matrix.data
    diagonal = np.zeros(n)
    exact = exactly_symmetric(*entries, diagonal)
    if diagonal.min(initial=0.0) < 0.0:
        row = int(np.argmin(diagonal))
        rule = "must have a diagonal without negative entries"
        raise DataError(what, rule, row=row, value=float(diagonal[row]))
    if exact:
        return matrix, diagonal
    size = np.sqrt(np.maximum(diagonal, HELD * float(diagonal.max(initial=0.0))))
    excess, *at = largest_asymmetry(*entries, size, ASYMMETRY)
    if excess > 0.0:
        raise asymmetric(what, tuple(at), float(matrix[at[0], at[1]]), float(matrix[at[1], at[0]]))
    return (0.5 * (matrix + matrix.T)).tocsc(), diagonal
