"""How well a linear system of the solver is conditioned."""

from __future__ import annotations

import numpy as np

from .errors import SolverError
from .normal_equations import NormalEquations


def condition_number(equations: NormalEquations) -> float:
    """Of the Jacobi-scaled reduced camera system, any prior included; infinite where it is singular.

    (The scaling is that of the solver's damping, so a large weight alone does not make it large.)
    """
    try:
        S = equations.eliminate().matrix
    except SolverError:
        return np.inf  # a landmark's own block is singular
    diagonal = np.diagonal(S)
    if not np.all(diagonal > 0.0):
        return np.inf
    scale = 1.0 / np.sqrt(diagonal)
    values = np.linalg.eigvalsh(S * scale[:, None] * scale)
    smallest, largest = float(values[0]), float(values[-1])
    return largest / smallest if smallest > np.finfo(float).eps * largest else np.inf
