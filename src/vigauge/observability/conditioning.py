"""Spectrum and condition of a linear system of the solver, whatever its units."""

from __future__ import annotations

import numpy as np

from ..errors import SolverError
from ..geometry.so3 import Array
from ..solver.normal_equations import NormalEquations


def scaled_eigenvalues(matrix: Array) -> Array:
    """Eigenvalues, ascending, of a symmetric matrix scaled to a unit diagonal (Jacobi scaling)."""
    scale = 1.0 / np.sqrt(np.diagonal(matrix))
    return np.linalg.eigvalsh(matrix * scale[:, None] * scale)


def condition_number(equations: NormalEquations) -> float:
    """Of the Jacobi-scaled reduced camera system, any prior included; infinite where it is singular.

    (The scaling is that of the solver's damping, so a large weight alone does not make it large.)
    """
    try:
        S = equations.eliminate().matrix
    except SolverError:
        return np.inf  # a landmark's own block is singular
    if not np.all(np.diagonal(S) > 0.0):
        return np.inf
    values = scaled_eigenvalues(S)
    smallest, largest = float(values[0]), float(values[-1])
    return largest / smallest if smallest > np.finfo(float).eps * largest else np.inf
