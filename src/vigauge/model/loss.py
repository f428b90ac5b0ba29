"""Robust losses of reprojection errors: outliers pull less, and need not be removed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..arrays import number
from ..errors import DataError
from ..kernels import loss

# Their squares, and the inverses of these, are numbers. A loss beyond them is none, or sees no image.
_LEAST, _MOST = 1e-100, 1e100


@dataclass(frozen=True)
class Loss:
    """What :class:`Huber` and :class:`Cauchy` have in common.

    s is the squared length of one whitened reprojection error (both coordinates together), and ``delta`` a
    length in standard deviations of a pixel coordinate. The cost is 1/2 sum rho(s), the weight rho'(s).

    Raises DataError unless ``delta`` is a number in 1e-100 .. 1e100.
    """

    delta: float
    kind: ClassVar[str]

    def __post_init__(self) -> None:
        name = type(self).__name__
        delta = number(name, self.delta, field="delta", above=0.0)
        if not _LEAST <= delta <= _MOST:
            rule = f"must lie in {_LEAST:g}..{_MOST:g}, in standard deviations of a pixel coordinate"
            raise DataError(name, rule, field="delta", value=delta)
        object.__setattr__(self, "delta", delta)

    @property
    def compiled(self) -> loss.Loss:
        """The loss as the kernels read it."""
        return loss.Loss(**{self.kind: self.delta})


class Huber(Loss):
    """Errors longer than ``delta`` count linearly: rho(s) = s up to delta^2, then 2 delta sqrt(s) - delta^2.

    The weight is 1, then delta / sqrt(s). ``HuberLoss(delta)`` of Ceres.
    """

    kind = "huber"


class Cauchy(Loss):
    """The longer an error, the less it pulls: rho(s) = delta^2 log(1 + s / delta^2).

    The weight 1 / (1 + s / delta^2) is a half at ``delta``. The cost may have several minima, so the start
    matters. ``CauchyLoss(delta)`` of Ceres.
    """

    kind = "cauchy"


LOSSES: dict[str, type[Loss]] = {kind.kind: kind for kind in (Huber, Cauchy)}
