"""Robust losses rho(s) of the squared length s of one whitened reprojection error, as Ceres defines them.

Both are concave, and where rho'' <= 0 Ceres' corrector leaves out the second-order term of Triggs: residual
and Jacobian are scaled by sqrt(rho'), which is the whole correction. H = sum rho' J^T J is then never
indefinite. A loss of None is a type of its own to the compiler, so the kernels without one do not change.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .compiled import part

HUBER, CAUCHY = 0, 1


class Loss(NamedTuple):
    """``kind`` HUBER or CAUCHY; ``delta`` in standard deviations."""

    kind: int
    delta: float


@part
def rho(s: float, loss: Loss | None) -> float:
    """The loss: s where it is small, 2 delta sqrt(s) - delta^2 or delta^2 log(1 + s / delta^2)."""
    if loss is None:
        return s
    square = loss.delta * loss.delta
    if loss.kind == CAUCHY:
        return square * math.log1p(s / square)
    return s if s <= square else 2.0 * loss.delta * math.sqrt(s) - square


@part
def root_weight(s: float, loss: Loss | None) -> float:
    """sqrt(rho'(s)), by which residual and Jacobian are scaled: from 1 towards 0."""
    if loss is None:
        return 1.0
    square = loss.delta * loss.delta
    if loss.kind == CAUCHY:
        return math.sqrt(1.0 / (1.0 + s / square))
    return 1.0 if s <= square else math.sqrt(loss.delta / math.sqrt(s))
