"""An information matrix with the estimate that it belongs to: what readers of files hand on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..covariance.estimate import EstimateCovariance
from ..covariance.information import from_hessian
from ..gauge.group import Group
from ..gauge.layout import Index, Layout
from ..geometry.so3 import Array
from ..observability.audit import Concern, audit


@dataclass(frozen=True, eq=False)
class Information:
    """An information matrix, the estimate it belongs to, and the motions that may not be seen."""

    H: Any
    layout: Layout
    R: Array
    p: Array
    velocities: Array | None
    points: Array | None
    group: Group
    gravity: object
    times_ns: Index | None = None

    @property
    def estimate(self) -> dict[str, Any]:
        """Arguments that the library's functions on layouts share."""
        return {
            "layout": self.layout,
            "poses": (self.R, self.p),
            "velocities": self.velocities,
            "points": self.points,
            "group": self.group,
            "gravity": self.gravity,
        }

    def covariance(self) -> EstimateCovariance:
        return from_hessian(self.H, **self.estimate)

    def audit(self) -> tuple[Concern, ...]:
        """What looks wrong with H, as :func:`vigauge.audit` says it."""
        return audit(self.H, **self.estimate)
