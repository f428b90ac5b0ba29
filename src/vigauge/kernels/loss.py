"""Robust losses rho(s) of the squared length s of one whitened reprojection error, as Ceres defines them.

Both are concave, and where rho'' <= 0 Ceres' corrector leaves out the second-order term of Triggs: residual
and Jacobian are scaled by sqrt(rho'), which is the whole correction. A ``delta`` of None is a type of its own
to the compiler, so each loss has kernels of its own, and those without a loss hold no trace of it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .compiled import part


class Loss(NamedTuple):
    """``delta`` of the loss that there is, in standard deviations; at most one of them."""

    huber: float | None = None
    cauchy: float | None = None


@part
def rho(s: float, huber: float | None, cauchy: float | None) -> float:
    """s; or 2 delta sqrt(s) - delta^2 beyond delta^2; or delta^2 log(1 + s / delta^2)."""
    if huber is not None:
        return s if s <= huber * huber else huber * (2.0 * math.sqrt(s) - huber)
    if cauchy is not None:
        return cauchy * cauchy * math.log1p(s / (cauchy * cauchy))
    return s


@part
def root_weight(s: float, huber: float | None, cauchy: float | None) -> float:
    """sqrt(rho'(s)), by which residual and Jacobian are scaled: from 1 towards 0."""
    if huber is not None:
        return 1.0 if s <= huber * huber else math.sqrt(huber / math.sqrt(s))
    if cauchy is not None:
        return math.sqrt(1.0 / (1.0 + s / (cauchy * cauchy)))
    return 1.0
