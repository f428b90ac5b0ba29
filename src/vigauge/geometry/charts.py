"""The ways in which estimators write a small change of a pose, as data: one table, one matrix for each.

A chart says where the six numbers of an increment act. All are compared with the increment in W,
p <- p + dp, R <- Exp(dphi) R, with R and p of the body (camera) in the world.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..arrays import reals, require_rotations, shape_of
from ..errors import DataError
from .so3 import Array, hat

_ROTATION_FIRST = [3, 4, 5, 0, 1, 2]


@dataclass(frozen=True)
class Chart:
    """One convention: side of the rotation, angles or half angles, what the position part moves.

    Attributes
    ----------
    side : "left" (increments in W) or "right" (in the body frame)
    factor : increment of the rotation by the angle that it turns; 0.5 for parts of a quaternion
    position : "world" (p in W), "body" (R^T dp), "inverse" (the shift of the pose's inverse), or "twist"
        (the shift of a motion that multiplies the pose on the left)
    rotation_first : whether (rotation, position) is the order of the six numbers, not (position, rotation)
    inverse : whether the estimator's rotation is that of the inverse (camera from world)
    """

    side: str
    factor: float = 1.0
    position: str = "world"
    rotation_first: bool = False
    inverse: bool = False

    def from_world(self, R: Array, p: Array) -> Array:
        """(N, 6, 6) own increment (position, rotation) by that in W (position, rotation), of poses R, p."""
        A = np.zeros((len(R), 6, 6))
        R_T = R.swapaxes(1, 2)
        turn = R_T if self.side == "right" else np.broadcast_to(np.eye(3), R.shape)
        A[:, 3:, 3:] = (-self.factor if self.inverse else self.factor) * turn
        if self.position == "body":
            A[:, :3, :3] = R_T
        elif self.position == "inverse":
            # t = -R^T p, so dt = R^T (dphi x p - dp).
            A[:, :3, :3], A[:, :3, 3:] = -R_T, -R_T @ hat(p)
        else:
            A[:, :3, :3] = np.eye(3)
            if self.position == "twist":
                A[:, :3, 3:] = hat(p)
        return A

    def to_world(self, R: Array, p: Array) -> Array:
        """(N, 6, 6) increment in W by the own one: the inverse of :meth:`from_world`."""
        A = np.zeros((len(R), 6, 6))
        turn = R if self.side == "right" else np.eye(3)
        A[:, 3:, 3:] = (-turn if self.inverse else turn) / self.factor
        A[:, :3, :3] = {"body": R, "inverse": -R}.get(self.position, np.eye(3))
        if self.position in ("inverse", "twist"):
            A[:, :3, 3:] = -hat(p) @ A[:, 3:, 3:]
        return A

    def to(self, other: Chart, R: Array, p: Array) -> Array:
        """(N, 6, 6) the other chart's increment, in its own order, by (position, rotation) of this one."""
        A = other.from_world(R, p) @ self.to_world(R, p)
        return A[:, _ROTATION_FIRST] if other.rotation_first else A


CHARTS = {
    # p + dp, Exp(dphi) R: our own, OKVIS, Basalt.
    "left": Chart("left"),
    # geometry_msgs/PoseWithCovariance: turns about the fixed axes of the frame, after the position.
    "ros": Chart("left"),
    # p + dp, R Exp(dphi): VINS and most preintegration papers.
    "right": Chart("right"),
    # T Exp(xi), rotation first.
    "gtsam": Chart("right", position="body", rotation_first=True),
    # Exp(xi) T, position first.
    "se3": Chart("left", position="twist"),
    # Quaternion and translation of camera from world, by Ceres' quaternion manifold: half angles.
    "colmap": Chart("right", factor=0.5, position="inverse", rotation_first=True, inverse=True),
    # Quaternion and position of body in world, by Ceres' quaternion manifold.
    "ceres": Chart("left", factor=0.5),
    # VertexSE3: (shift in the body frame, vector part of a quaternion).
    "g2o": Chart("right", factor=0.5, position="body"),
}


def chart_named(argument: str, name: str) -> Chart:
    """The chart of a name; DataError lists the names."""
    if not isinstance(name, str) or name not in CHARTS:
        raise DataError(argument, f"must be one of {', '.join(CHARTS)}", value=name)
    return CHARTS[name]


class Poses(NamedTuple):
    """R_WB (N, 3, 3) and p_W (N, 3) that :func:`poses_of` has checked, and need not again."""

    R: Array
    p: Array


def poses_of(poses: object, count: int | None = None) -> Poses:
    """R_WB (N, 3, 3) and p_W (N, 3) of poses (N, 4, 4) or (N, 3, 4), or of a pair (R_WB, p_W).

    Raises DataError for other shapes or a matrix that is no rotation.
    """
    if isinstance(poses, Poses) and len(poses.p) == count:
        return poses
    if isinstance(poses, tuple) and len(poses) == 2:
        R = reals("poses", poses[0], ("N" if count is None else count, 3, 3), field="R")
        p = reals("poses", poses[1], (len(R), 3), field="p")
    else:
        T = reals("poses", poses, ("N" if count is None else count, "3 or 4", 4))
        if T.shape[1] not in (3, 4):
            raise DataError("poses", "must have shape (N, 4, 4) or (N, 3, 4)", value=T.shape)
        R, p = np.ascontiguousarray(T[:, :3, :3]), np.ascontiguousarray(T[:, :3, 3])
    require_rotations("poses", R)
    return Poses(R, p)


def as_convention(
    covariance: Array, R: Array, *, to: str, p: Array | None = None, source: str = "left"
) -> Array:
    """Covariances of poses in another convention: side, order, half angles.

    Parameters
    ----------
    covariance : (6, 6) or (N, 6, 6) by the convention ``source``, in that convention's own order
    R : (3, 3) or (N, 3, 3) R_WB of the poses
    to : "left" (position, rotation; both in W), "ros" (the same: PoseWithCovariance has x, y, z, then turns
        about the fixed axes), "right" (position in W, rotation in B), "gtsam" (rotation, position; both in
        B), "se3" (left multiplication), "colmap" (half angles, then translation, of camera from world),
        "ceres" (position, half angles in W), "g2o" (position, half angles; both in B)
    p : (3,) or (N, 3) p_W, needed by "colmap" and "se3"
    source : name of the convention given

    Raises DataError for another shape, an unknown name, or positions that are missing.
    """
    charts = chart_named("source", source), chart_named("to", to)
    single = len(shape_of("covariance", covariance)) == 2
    shape: tuple[int | str, ...] = (6, 6) if single else ("N", 6, 6)
    C = reals("covariance", covariance, shape, matrix=True).reshape(-1, 6, 6)
    R = reals("R", R, (3, 3) if single else (len(C), 3, 3)).reshape(-1, 3, 3)
    require_rotations("R", R)
    if p is None:
        if any(chart.position in ("inverse", "twist") for chart in charts):
            raise DataError("p", f"must be given: '{to}' or '{source}' turns positions about the origin")
        p = np.zeros((len(C), 3))
    p = reals("p", p, (3,) if single and len(shape_of("p", p)) == 1 else (len(C), 3)).reshape(-1, 3)
    J = charts[0].to(charts[1], R, p)
    J = J[:, :, _ROTATION_FIRST] if charts[0].rotation_first else J
    out = J @ C @ J.swapaxes(1, 2)
    out = 0.5 * (out + out.swapaxes(1, 2))
    return out[0] if single else out
