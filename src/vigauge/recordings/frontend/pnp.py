"""The pose of a camera from known points (perspective-n-point) with RANSAC."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...geometry import so3
from ...geometry.camera import project
from ...geometry.so3 import Array

# OpenCV's RANSAC draws from a generator that it seeds itself on every call, so equal
# input gives equal output; what else it uses at random is seeded here.
_SEED = 0
_CONFIDENCE = 0.9999
_LEAST_POINTS = 5
_REFINEMENTS = 2
_NEWTON_STEPS = 5


@dataclass(frozen=True)
class CameraPose:
    """x_C = R_CM x_M + p_CM for points x_M of the map; ``inlier`` (m,) tells which points agree."""

    R_CM: Array
    p_CM: Array
    inlier: NDArray[np.bool_]

    @property
    def n_inliers(self) -> int:
        return int(np.count_nonzero(self.inlier))


def reprojection_error(K: Array, R_CM: Array, p_CM: Array, points_M: Array, uv: Array) -> Array:
    """(m,) distances in px; infinite for points behind the camera."""
    points_C = np.einsum("ij,mj->mi", R_CM, points_M) + p_CM
    ahead = points_C[:, 2] > 1e-6
    points_C[~ahead] = [0.0, 0.0, 1.0]
    predicted, _ = project(points_C, K[0, 0], K[1, 1], K[0, 2], K[1, 2])
    return np.where(ahead, np.linalg.norm(predicted - uv, axis=1), np.inf)


def estimate_pose(
    points_M: Array,
    uv: Array,
    K: Array,
    reprojection_px: float,
    rounds: int,
    seed: int = 0,
    size: Array | float = 1.0,
) -> CameraPose | None:
    """Pose from points (m, 3) m and their ideal pixels (m, 2); None where too few points agree.

    RANSAC over minimal sets, then least squares over the inliers, which are chosen anew
    after each refinement. A ``seed`` other than 0 shuffles the points for RANSAC, which draws the same
    numbers in every call. ``size`` (m,) are ideal pixels to a measured one (``ideal_size``): of a fisheye,
    errors far from the axis are larger, and ``reprojection_px`` is in measured ones.
    """
    if len(points_M) < _LEAST_POINTS:
        return None
    points = np.ascontiguousarray(points_M, dtype=np.float64)
    pixels = np.ascontiguousarray(uv, dtype=np.float64)
    order = np.random.default_rng(seed).permutation(len(points)) if seed else slice(None)
    start = _by_ransac(points[order], pixels[order], K, reprojection_px, rounds)
    if start is None:
        return None
    R_CM, p_CM = start
    for _ in range(_REFINEMENTS):
        inlier = reprojection_error(K, R_CM, p_CM, points, pixels) / size <= reprojection_px
        if np.count_nonzero(inlier) < _LEAST_POINTS:
            return None
        rotation, translation = cv2.solvePnPRefineLM(
            points[inlier], pixels[inlier], K, None, so3.log(R_CM)[:, None], p_CM[:, None]
        )
        R_CM, p_CM = so3.exp(rotation.ravel()), translation.ravel()
        weight = np.broadcast_to(1.0 / np.square(size), inlier.shape)[inlier]
        R_CM, p_CM = _to_the_minimum(K, R_CM, p_CM, points[inlier], pixels[inlier], weight)
    if not (np.all(np.isfinite(R_CM)) and np.all(np.isfinite(p_CM))):
        return None
    inlier = reprojection_error(K, R_CM, p_CM, points, pixels) / size <= reprojection_px
    return CameraPose(R_CM, p_CM, inlier)


def _by_ransac(
    points_M: Array, uv: Array, K: Array, reprojection_px: float, rounds: int
) -> tuple[Array, Array] | None:
    """R_CM and p_CM of the minimal set that most points agree with; None where there is none."""
    cv2.setRNGSeed(_SEED)
    found, rotation, translation, _ = cv2.solvePnPRansac(
        points_M,
        uv,
        K,
        None,
        iterationsCount=rounds,
        reprojectionError=reprojection_px,
        confidence=_CONFIDENCE,
        flags=cv2.SOLVEPNP_SQPNP,
    )
    return (so3.exp(rotation.ravel()), translation.ravel()) if found else None


def _to_the_minimum(
    K: Array, R_CM: Array, p_CM: Array, points_M: Array, uv: Array, weight: Array
) -> tuple[Array, Array]:
    """A refined pose, to rounding, by Gauss-Newton; squared errors have the ``weight`` (m,).

    OpenCV compares costs, so it stops some 1e-7 m from the minimum, at another place on another processor:
    enough to turn an inlier into an outlier. It ends early where a point is not in front of the camera.
    """
    for _ in range(_NEWTON_STEPS):
        turned = np.einsum("ij,mj->mi", R_CM, points_M)
        if not np.all(turned[:, 2] + p_CM[2] > 1e-6):
            break
        predicted, by_point = project(turned + p_CM, K[0, 0], K[1, 1], K[0, 2], K[1, 2])
        J = np.concatenate([-np.einsum("mij,mjk->mik", by_point, so3.hat(turned)), by_point], axis=2)
        weighted = weight[:, None, None] * J
        H, g = np.einsum("mia,mib->ab", weighted, J), np.einsum("mia,mi->a", weighted, uv - predicted)
        step = np.linalg.lstsq(H, g, rcond=None)[0]
        R_CM, p_CM = so3.exp(step[:3]) @ R_CM, p_CM + step[3:]
    return R_CM, p_CM
