"""Which directions of the orbit a problem's motion factors measure.

Images and inertial measurements do not change along the orbit, so the information along it is that
of the motion factors alone: U^T H U is the sum of (J U)^T (J U) over them.
"""

from __future__ import annotations

import numpy as np

from ..geometry.so3 import Array
from ..model.problem import Problem
from ..model.state import State
from ..solver.factors import in_total_increments, linear_factors
from ..sparsity.rounding import rounding


def seen_along(problem: Problem, state: State, tangent: Array) -> Array:
    """(m, d) change of the motion factors' residuals along the columns of a tangent (9N + 3K, d).

    Each row is scaled by the largest change that its entries could give: what is left of a residual
    that does not change is a rounding error next to one.
    """
    rows = [np.zeros((0, tangent.shape[1]))]
    for factor in linear_factors(problem, state):
        linear = in_total_increments(factor, state)
        moved = tangent[linear.columns]
        size = np.abs(linear.jacobian) @ np.abs(moved).max(axis=1)
        rows.append((linear.jacobian @ moved)[size > 0.0] / size[size > 0.0, None])
    along = np.concatenate(rows)
    return np.where(np.abs(along) > rounding(len(along)), along, 0.0)


def open_directions(along: Array) -> Array:
    """(d, c) orthonormal combinations of a tangent's columns that no motion factor sees."""
    _, sizes, vectors = np.linalg.svd(along)
    rank = int(np.count_nonzero(sizes > rounding(len(along)) * max(float(sizes.max(initial=0.0)), 1.0)))
    return vectors[rank:].T
