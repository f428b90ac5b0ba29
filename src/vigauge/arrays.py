"""The one gate for numbers from outside: what passes is float64 or int64, and of the shape asked for.

Lists, ``np.matrix`` and other array-likes are converted. Complex, bool and object entries, masked
arrays, NaN, infinity, numbers whose products overflow and other shapes are refused. Measurements may come
as 32-bit floats: the number is taken as it stands, good to 6e-8 of itself. A matrix that is inverted or
projected may not, as its weakest information lies below that. A sparse matrix is served where a dense one
of its size is the answer, and refused elsewhere.
"""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from .errors import DataError

Array = NDArray[np.floating[Any]]
T = TypeVar("T")

# No quantity is as large; products of three such numbers are still finite.
LARGEST = 1e100
# Largest difference of two entries that ought to be equal, next to the root of their diagonal entries.
ASYMMETRY = 1e-8
# Diagonal entries below this share of the largest are zero to rounding (rows that a gauge holds).
HELD = 1e-12


def reals(
    what: str, value: object, shape: tuple[int | str, ...], *, field: str | None = None, matrix: bool = False
) -> Array:
    """``value`` as finite float64 of a shape, row by row; a letter in ``shape`` stands for any length.

    ``matrix``: 32-bit floats are refused, and a sparse matrix is made dense.

    Raises DataError.
    """
    array = _array(what, value, field, matrix) if type(value) is not np.ndarray else value
    if array.dtype != np.float64:
        kind, size = array.dtype.kind, array.dtype.itemsize
        if kind == "f" and size < (8 if matrix else 4):
            rule = f"must be 64-bit floats: those of {8 * size} bits have lost what is asked for"
            raise DataError(what, rule, field=field, value=str(array.dtype))
        if kind not in "iuf":
            raise DataError(what, "must hold real numbers", field=field, value=str(array.dtype))
        array = array.astype(np.float64)
    _require_shape(what, array, shape, field)
    # NaN, too, is not between these.
    if array.size and not (array.min() > -LARGEST and array.max() < LARGEST):
        at = tuple(map(int, np.argwhere(~(np.abs(array) < LARGEST))[0]))
        rule = f"must be below {LARGEST:.0e} in size" if np.isfinite(array[at]) else "must be finite"
        raise _misplaced(what, rule, at, field, float(array[at]))
    return np.ascontiguousarray(array).reshape(array.shape)


def integers(what: str, value: object, shape: tuple[int | str, ...], *, field: str | None = None) -> Any:
    """``value`` as int64 of a shape, as :func:`reals`. Floats and boolean masks are refused."""
    array = _array(what, value, field, False) if type(value) is not np.ndarray else value
    if array.dtype != np.int64:
        if array.dtype.kind == "b":
            rule = "must be integers; a mask says which with np.flatnonzero(mask)"
            raise DataError(what, rule, field=field, value="bool")
        # An empty list is one of floats.
        if array.dtype.kind not in ("iu" if array.size else "iuf"):
            raise DataError(what, "must be integers", field=field, value=str(array.dtype))
        array = array.astype(np.int64)
    _require_shape(what, array, shape, field)
    return np.ascontiguousarray(array)


def indices(what: str, value: object, count: int, *, field: str | None = None) -> NDArray[np.int64]:
    """(m,) numbers of things counted from zero, all of them for None; DataError for a missing one."""
    if value is None:
        return np.arange(count)
    index: NDArray[np.int64] = integers(what, value, ("m",), field=field)
    bad = np.flatnonzero((index < 0) | (index >= count))
    if bad.size:
        row = int(bad[0])
        raise DataError(what, f"must lie in 0..{count - 1}", field=field, row=row, value=int(index[row]))
    return index


def number(
    what: str, value: object, *, field: str | None = None, above: float = -math.inf, least: float = -math.inf
) -> float:
    """``value`` as a finite float above ``above``, at least ``least``; DataError otherwise, and for a bool or
    a string."""
    if type(value) is float and math.isfinite(value):
        out = value
    else:
        try:
            out = float(reals(what, value, (), field=field))
        except DataError as error:
            raise DataError(what, "must be a finite number", field=field, value=value) from error
    if out < least:
        raise DataError(what, f"must be at least {least:g}", field=field, value=out)
    if not out > above:
        rule = "must be positive" if above == 0.0 else f"must be above {above:g}"
        raise DataError(what, rule, field=field, value=out)
    return out


def integer(what: str, value: object, *, field: str | None = None) -> int:
    """``value`` as an int; DataError for a bool, and for a float even where it is whole."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
        raise DataError(what, "must be an integer", field=field, value=value)
    return int(value)


def shape_of(what: str, value: object, *, field: str | None = None) -> tuple[int, ...]:
    """The shape of an array-like; DataError for what is none, such as lists of different lengths."""
    return _array(what, value, field, True).shape


def vectors(what: str, value: object, count: int, *, field: str | None = None) -> Array:
    """(count, 3) of one vector (3,) for all, or of one each; DataError as :func:`reals`."""
    one = len(shape_of(what, value, field=field)) == 1
    return np.broadcast_to(reals(what, value, (3,) if one else (count, 3), field=field), (count, 3)).copy()


def instance(what: str, value: T, kind: type) -> T:
    """``value`` where it is a ``kind``; DataError otherwise, and for the class itself."""
    if not isinstance(value, kind) or isinstance(value, type):
        found = value.__name__ if isinstance(value, type) else type(value).__name__
        raise DataError(what, f"must be a {kind.__name__}", value=found)
    return value


def symmetric(what: str, value: object, n: int | str = "n") -> Array:
    """``value`` as a symmetric (n, n) matrix without negative diagonal entries; DataError otherwise.

    Entries (i, j) and (j, i) may differ by 1e-8 of the root of their diagonal entries, whatever their units.
    """
    matrix = reals(what, value, (n, n), matrix=True)
    diagonal = np.diagonal(matrix)
    floor = HELD * float(np.max(diagonal, initial=0.0))
    if not len(matrix) or diagonal.min() < -floor:
        row = int(np.argmin(diagonal)) if len(matrix) else None
        value = float(diagonal[row]) if row is not None else matrix.shape
        raise DataError(what, "must have a diagonal without negative entries", row=row, value=value)
    size = np.sqrt(np.maximum(diagonal, floor))
    excess = np.abs(matrix - matrix.T) - (ASYMMETRY * size)[:, None] * size
    if excess.max() > 0.0:
        at = np.unravel_index(int(np.argmax(excess)), matrix.shape)
        raise asymmetric(what, tuple(map(int, at)), float(matrix[at]), float(matrix.T[at]))
    return matrix


def asymmetric(what: str, at: tuple[int, ...], value: float, mirrored: float) -> DataError:
    """The error of two entries that ought to be equal."""
    rule = "must be symmetric; where only rounding is in the way, give 0.5 * (A + A.T)"
    if not (value and mirrored):
        rule = "must be symmetric, with both triangles; give L + L.T - diag(diagonal) of one triangle L"
    return _misplaced(what, rule, at, None, (value, mirrored))


def sparse_reals(what: str, value: Any, shape: tuple[int | str, int]) -> Any:
    """``value``, dense or of scipy.sparse, as float64 in compressed columns; DataError as :func:`reals`."""
    import scipy.sparse  # seldom needed, and slow to import

    if not scipy.sparse.issparse(value):
        return scipy.sparse.csc_array(reals(what, value, shape, matrix=True))
    _require_shape(what, value, shape, None)
    matrix = scipy.sparse.csc_array(value)
    matrix.sum_duplicates()
    matrix.data = reals(what, matrix.data, ("nnz",), field="data", matrix=True)
    # SciPy takes any index; rows of a column are sorted now.
    filled = np.flatnonzero(np.diff(matrix.indptr))
    first, last = matrix.indices[matrix.indptr[filled]], matrix.indices[matrix.indptr[filled + 1] - 1]
    if filled.size and (first.min() < 0 or last.max() >= matrix.shape[0]):
        rule = f"must be rows of the matrix, 0..{matrix.shape[0] - 1}"
        value = int(first.min() if first.min() < 0 else last.max())
        raise DataError(what, rule, field="indices", value=value)
    return matrix


def require_rotations(what: str, R: Array, *, field: str | None = None) -> None:
    """DataError where one of (M, 3, 3) finite matrices is no rotation, good to 1e-6."""
    # Entries outside [-2, 2] are no rotation's, and their products may overflow.
    small = np.abs(R).max(axis=(1, 2), initial=0.0) < 2.0
    R_small = np.where(small[:, None, None], R, 0.0)
    drift = np.abs(R_small @ R_small.swapaxes(1, 2) - np.eye(3)).max(axis=(1, 2), initial=0.0)
    handed = np.sum(np.cross(R_small[:, 0], R_small[:, 1]) * R_small[:, 2], axis=1) > 0.0
    drift = np.maximum(drift, np.where(handed, 0.0, 2.0))
    if np.any(drift > 1e-6):
        row = int(np.argmax(drift))
        raise DataError(what, "must be a rotation matrix", field=field, row=row, value=R[row])


def require_symmetric(what: str, matrices: Array, *, field: str | None = None) -> None:
    """DataError where one of (M, n, n) matrices is not symmetric, as :func:`symmetric` measures it."""
    size = np.sqrt(np.abs(np.diagonal(matrices, axis1=1, axis2=2)))
    excess = np.abs(matrices - matrices.swapaxes(1, 2)) - ASYMMETRY * size[:, :, None] * size[:, None, :]
    wrong = np.flatnonzero(excess.max(axis=(1, 2), initial=0.0) > 0.0)
    if wrong.size:
        raise DataError(what, "must be symmetric", field=field, row=int(wrong[0]))


def _array(what: str, value: object, field: str | None, matrix: bool) -> np.ndarray:
    if isinstance(value, np.ma.MaskedArray):
        raise DataError(what, "must not be masked: fill it or leave rows out", field=field)
    to_dense = getattr(value, "toarray", None)
    if to_dense is not None:
        if not matrix:
            raise DataError(what, "must be dense: call .toarray()", field=field, value=type(value).__name__)
        value = to_dense()
    try:
        return np.asarray(value)
    except (TypeError, ValueError, RuntimeError) as error:
        raise DataError(
            what, f"must be an array ({error})", field=field, value=type(value).__name__
        ) from error


def _require_shape(what: str, array: np.ndarray, shape: tuple[int | str, ...], field: str | None) -> None:
    found = array.shape
    lengths: dict[str, int] = {}
    fits = len(found) == len(shape)
    for length, wanted in zip(found, shape, strict=False):
        fits &= length == (lengths.setdefault(wanted, length) if isinstance(wanted, str) else wanted)
    if not fits:
        words = f"({', '.join(map(str, shape))}{',' * (len(shape) == 1)})"
        raise DataError(what, f"must have shape {words}", field=field, value=found)


def _misplaced(what: str, rule: str, at: tuple[int, ...], field: str | None, value: object) -> DataError:
    """The error of one entry: its row, and its columns beside the field or in place of one."""
    column = f"column {', '.join(map(str, at[1:]))}" if len(at) > 1 else None
    if field and column:
        rule += f" (in {column})"
    return DataError(what, rule, row=at[0] if at else None, field=field or column, value=value)
