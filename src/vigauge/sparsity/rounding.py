"""What is zero to rounding."""

from __future__ import annotations

import numpy as np

# Information below this is none: its inverse would overflow.
NOTHING = 1e-100


def rounding(n: int) -> float:
    """Share of the largest eigenvalue of an (n, n) matrix below which an eigenvalue is a rounding error.

    The matrix is scaled to a unit diagonal. The error of a sum grows with its length; below a hundred
    terms it is that of the sums over observations.
    """
    return 10.0 * max(n, 100) * float(np.finfo(float).eps)
