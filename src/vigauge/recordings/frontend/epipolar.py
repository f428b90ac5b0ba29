"""The relative pose of two views from matches alone: no depth is needed, so none can spoil it.

A stereo depth of ten metres is off by metres. Seen from far beside, such points agree on no pose, or on
a wrong one; the lines that they lie on stay right. The depths serve for the length of the step only.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ...geometry.so3 import Array

_CONFIDENCE, _ROUNDS = 0.9999, 5000
_LEAST_MATCHES = 8
_LEAST_DEPTHS = 5


def relative_pose(
    uv_first: Array, uv_second: Array, K: Array, epipolar_px: float
) -> tuple[Array, Array, NDArray[np.bool_]] | None:
    """R (3, 3) and unit t (3,) of x_2 ~ R x_1 + s t from ideal pixels (m, 2), and which (m,) matches agree.

    None where there are too few matches. OpenCV's MAGSAC seeds itself: equal input, equal output.
    """
    if len(uv_first) < _LEAST_MATCHES:
        return None
    first, second = np.ascontiguousarray(uv_first), np.ascontiguousarray(uv_second)
    E, agree = cv2.findEssentialMat(
        first, second, K, cv2.USAC_MAGSAC, _CONFIDENCE, epipolar_px, maxIters=_ROUNDS
    )
    if E is None or E.shape != (3, 3):
        return None
    _, R, t, ahead = cv2.recoverPose(E, first, second, K, mask=agree.copy())
    return R, t.ravel(), ahead.ravel() > 0


def length_of_step(R: Array, t: Array, points_1: Array, uv_second: Array, K: Array) -> float | None:
    """s of x_2 = R x_1 + s t by the median over points (m, 3), m, in view 1; NaN rows are left out.

    Each point alone gives s by s (ray x t) = -ray x R x_1. None where too few points have a depth.
    """
    known = np.isfinite(points_1[:, 0])
    if np.count_nonzero(known) < _LEAST_DEPTHS:
        return None
    ray = np.column_stack([uv_second[known], np.ones(np.count_nonzero(known))]) @ np.linalg.inv(K).T
    turned, along = np.cross(ray, points_1[known] @ R.T), np.cross(ray, t)
    return -float(np.median(np.sum(turned * along, axis=1) / np.sum(along**2, axis=1)))
