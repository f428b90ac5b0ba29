"""Motion factors of a problem at a state, and their share of the normal equations."""

from __future__ import annotations

import numpy as np

from ..geometry.so3 import Array
from ..kernels import symmetric
from ..model import first_rotation
from ..model.factors import LinearFactor
from ..model.problem import Problem
from ..model.state import State
from ..sparsity.layout import Layout


def linear_factors(problem: Problem, state: State) -> list[LinearFactor]:
    """The problem's motion factors at a state. DataError where one gives shapes or numbers that are wrong."""
    return [
        factor.at(state, problem.initial).require_valid(f"motion factor {i} ({type(factor).__name__})", state)
        for i, factor in enumerate(problem.factors)
    ]


def in_total_increments(factor: LinearFactor, state: State) -> LinearFactor:
    """The factor with the first rotation's columns in the total increment of Eq. (9)."""
    first = first_rotation.columns(state.n_keyframes)
    if factor.total or not np.isin(first, factor.columns).any():
        return factor
    columns = np.union1d(factor.columns, first)
    J = np.zeros((len(factor.residual), len(columns)))
    J[:, np.searchsorted(columns, factor.columns)] = factor.jacobian
    at = np.searchsorted(columns, first)
    J[:, at] = J[:, at] @ first_rotation.chain(state)
    return LinearFactor(columns, factor.residual, J, total=True)


def add_factor(factor: LinearFactor, layout: Layout, storage: Array, gradient: Array) -> None:
    """Add J^T J to the stored triangle and J^T r to the gradient (9N,) in stored order, in place.

    Raises SolverError where the factor joins keyframes that the band does not.
    """
    at = layout.stored[factor.columns]
    layout.require_near(at)
    symmetric.add_factor(storage, gradient, at, layout.stride, factor.jacobian, factor.residual)
