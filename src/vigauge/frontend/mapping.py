"""Keyframe poses one after the other: PnP against the map so far, then new points into the map.

Poses are in the frame M of the map: the body at the first keyframe.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..camera import Camera
from ..errors import DataError
from ..so3 import Array
from .pnp import CameraPose, estimate_pose
from .settings import PoseSettings, TriangulationSettings
from .tracks import LEFT, Index, Tracks
from .triangulation import triangulate


@dataclass(frozen=True)
class Map:
    """Poses by PnP and what they left of the tracks.

    Attributes
    ----------
    p_M, R_MB : (N, 3) m, (N, 3, 3) body poses
    tracks : the observations without those that PnP refused
    tried, inliers : (N,) points of the map seen at each keyframe, and those that agreed; the
        first keyframe defines the map and has none
    n_refused : observations that PnP refused
    """

    p_M: Array
    R_MB: Array
    tracks: Tracks
    tried: Index
    inliers: Index
    n_refused: int


def pose_keyframes(
    cameras: tuple[Camera, Camera],
    tracks: Tracks,
    n_keyframes: int,
    pose: PoseSettings,
    triangulation: TriangulationSettings,
) -> Map:
    """Poses of all keyframes by PnP RANSAC of the left camera.

    Raises
    ------
    DataError
        where a keyframe sees too few points of the map or too few of them agree on a pose.
    """
    # The map takes points that stereo alone sees well enough to find a pose by.
    loose = replace(triangulation, parallax_deg=pose.map_parallax_deg, keyframes=1)
    left = cameras[LEFT]
    p_M, R_MB = np.zeros((n_keyframes, 3)), np.tile(np.eye(3), (n_keyframes, 1, 1))
    tried, inliers = np.zeros(n_keyframes, dtype=np.int64), np.zeros(n_keyframes, dtype=np.int64)
    points = np.full((tracks.n_tracks, 3), np.nan)
    keep = np.ones(len(tracks.track), dtype=bool)
    for k in range(n_keyframes):
        rows, track, uv = tracks.seen_at(k, LEFT)
        if k:
            known = np.isfinite(points[track, 0])
            found = estimate_pose(points[track[known]], uv[known], left.K, pose.reprojection_px, pose.rounds)
            tried[k] = np.count_nonzero(known)
            inliers[k] = found.n_inliers if found else 0
            if found is None or inliers[k] < pose.inliers:
                rule = f"at least {pose.inliers} points of the map must agree on its pose ({tried[k]} seen)"
                raise DataError("front-end", rule, row=k, field="keyframe", value=int(inliers[k]))
            R_MB[k], p_M[k] = _body_pose(found, left)
            wrong = np.zeros(tracks.n_tracks, dtype=bool)
            wrong[track[known][~found.inlier]] = True
            keep &= ~((tracks.keyframe == k) & wrong[tracks.track])
        _extend(points, cameras, p_M, R_MB, tracks.where(keep), k, loose)
    return Map(p_M, R_MB, tracks.where(keep), tried, inliers, int(np.count_nonzero(~keep)))


def _body_pose(pose: CameraPose, camera: Camera) -> tuple[Array, Array]:
    """R_MB and p_M of the body from the pose of its camera."""
    R_MB = pose.R_CM.T @ camera.R_BC.T
    return R_MB, -pose.R_CM.T @ pose.p_CM - R_MB @ camera.p_BC


def _extend(
    points: Array,
    cameras: tuple[Camera, Camera],
    p_M: Array,
    R_MB: Array,
    tracks: Tracks,
    k: int,
    settings: TriangulationSettings,
) -> None:
    """Add to the map (``points``, in place) the tracks at keyframe k that are not in it yet."""
    new = np.zeros(len(points), dtype=bool)
    new[tracks.track[tracks.keyframe == k]] = True
    new &= ~np.isfinite(points[:, 0])
    number = np.flatnonzero(new)
    seen = tracks.where(tracks.keyframe <= k).renumbered(new)
    result = triangulate(cameras, p_M, R_MB, seen, settings)
    points[number[result.good]] = result.points_W[result.good]
