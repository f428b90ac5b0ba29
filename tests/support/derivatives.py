"""Numerical derivatives to compare analytic ones with."""

from collections.abc import Callable

import numpy as np


def central_differences(function: Callable[[np.ndarray], np.ndarray], size: int, step: float = 1e-3):
    """(m, size) Jacobian at zero of a function of a (size,) vector.

    Four points a column, so the error is of fourth order in the step: about 1e-12 of
    truncation and as much of rounding at 1e-3, where two points would give 1e-7.
    """
    columns = []
    for index in range(size):
        unit = np.zeros(size)
        unit[index] = step
        near = np.asarray(function(unit)) - np.asarray(function(-unit))
        far = np.asarray(function(2.0 * unit)) - np.asarray(function(-2.0 * unit))
        columns.append((8.0 * near - far) / (12.0 * step))
    return np.stack(columns, axis=-1)


def row_error(analytic: np.ndarray, numeric: np.ndarray) -> float:
    """Largest error of any row, relative to that row's length."""
    assert analytic.shape == numeric.shape
    assert np.all(np.isfinite(analytic)) and np.all(np.isfinite(numeric))
    length = np.maximum(np.linalg.norm(numeric, axis=-1), np.finfo(float).tiny)
    return float(np.max(np.linalg.norm(analytic - numeric, axis=-1) / length))
