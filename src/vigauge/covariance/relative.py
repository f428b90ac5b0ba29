"""Relative poses with covariances, and whether a measured one fits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from ..arrays import reals, symmetric
from ..errors import DegenerateError
from ..geometry import so3
from ..geometry.charts import poses_of
from ..geometry.so3 import Array
from ..sparsity.rounding import rounding

# Share of a relative pose's increment that an open direction may move by rounding.
_STILL = 1e-6


@dataclass(frozen=True, eq=False)
class MahalanobisTest:
    """Squared distance in standard deviations, and the probability of one as large or larger."""

    squared_distance: float
    degrees_of_freedom: int
    probability: float


@dataclass(frozen=True, eq=False)
class RelativePose:
    """Pose of a keyframe j in the frame of keyframe i.

    Attributes
    ----------
    R, p : (3, 3) R_i^T R_j and (3,) R_i^T (p_j - p_i)
    covariance : (6, 6) of (position, rotation), left increments: p + dp, Exp(dphi) R, in the frame of i;
        ``as_convention(covariance, R, to=...)`` takes it to others
    """

    R: Array
    p: Array
    covariance: Array

    def mahalanobis(self, measured: object, covariance: Array | None = None) -> MahalanobisTest:
        """Whether a measured pose of j in i (4, 4), (3, 4) or (R, p) fits, as for a loop closure.

        Poses of GTSAM and pycolmap, which have such a ``matrix()``, are taken too.
        ``covariance`` (6, 6): that of the measurement, by the same increments, if it has one.

        Raises DataError for other shapes, and DegenerateError where the sum of covariances is singular.
        """
        own = getattr(measured, "matrix", None)
        measured = own() if callable(own) else measured
        if isinstance(measured, tuple) and len(measured) == 2:
            R, p = reals("measured", measured[0], (3, 3)), reals("measured", measured[1], (3,))
            R, p = poses_of((R[None], p[None]))
        else:
            R, p = poses_of(reals("measured", measured, ("3 or 4", 4))[None])
        error = np.concatenate([p[0] - self.p, so3.log(R[0] @ self.R.T)])
        total = self.covariance
        if covariance is not None:
            total = total + symmetric("covariance", reals("covariance", covariance, (6, 6), matrix=True))
        scale = np.sqrt(np.diagonal(total))
        if not np.all(scale > 0.0):
            raise DegenerateError("the covariance of the relative pose is singular: some of it cannot vary")
        unit = total / scale[:, None] / scale
        if np.linalg.eigvalsh(unit)[0] < rounding(6):
            raise DegenerateError("the covariance of the relative pose is singular: some of it cannot vary")
        squared = float(error / scale @ np.linalg.solve(unit, error / scale))
        return MahalanobisTest(squared, 6, float(chdtrc(6, squared)))


def is_still(J: Array, U: Array) -> bool:
    """Whether no open direction, a column of U (c, d), moves a relative pose with derivative J (6, c)."""
    return bool(np.abs(J @ U).max(initial=0.0) <= _STILL * np.max(np.abs(J) @ np.abs(U), initial=1e-300))


def relative_pose(R_i: Array, p_i: Array, R_j: Array, p_j: Array) -> tuple[RelativePose, Array, Array]:
    """The relative pose, without covariance, and its (6, 6) derivatives by increments in W of both poses."""
    ray = p_j - p_i
    J_i, J_j = np.zeros((2, 6, 6))
    J_j[:3, :3] = J_j[3:, 3:] = R_i.T
    J_i[:3, :3] = J_i[3:, 3:] = -R_i.T
    J_i[:3, 3:] = R_i.T @ so3.hat(ray)
    return RelativePose(R_i.T @ R_j, R_i.T @ ray, np.zeros((6, 6))), J_i, J_j
