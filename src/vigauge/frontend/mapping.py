"""Keyframe poses one after the other, by PnP against the points that the keyframes just before see.

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

    The points for it are triangulated from the last ``pose.map_keyframes`` keyframes alone.
    A map that keeps its points for good gives a somewhat better start, but refuses
    observations for disagreeing with the map's own old errors, and what it leaves is biased
    towards the start.

    Raises
    ------
    DataError
        where a keyframe sees too few points of the map or too few of them agree on a pose.
    """
    left = cameras[LEFT]
    p_M, R_MB = np.zeros((n_keyframes, 3)), np.tile(np.eye(3), (n_keyframes, 1, 1))
    tried, inliers = np.zeros(n_keyframes, dtype=np.int64), np.zeros(n_keyframes, dtype=np.int64)
    keep = np.ones(len(tracks.track), dtype=bool)
    for k in range(1, n_keyframes):
        _, track, uv = tracks.seen_at(k, LEFT)
        recent = keep & (tracks.keyframe < k) & (tracks.keyframe >= k - pose.map_keyframes)
        points = _local_map(cameras, p_M, R_MB, tracks.where(recent), track, pose, triangulation)
        known = np.isfinite(points[:, 0])
        found = estimate_pose(points[known], uv[known], left.K, pose.reprojection_px, pose.rounds)
        tried[k] = np.count_nonzero(known)
        inliers[k] = found.n_inliers if found else 0
        if found is None or inliers[k] < pose.inliers:
            rule = f"at least {pose.inliers} points of the map must agree on its pose ({tried[k]} seen)"
            raise DataError("front-end", rule, row=k, field="keyframe", value=int(inliers[k]))
        R_MB[k], p_M[k] = _body_pose(found, left)
        wrong = np.zeros(tracks.n_tracks, dtype=bool)
        wrong[track[known][~found.inlier]] = True
        keep &= ~((tracks.keyframe == k) & wrong[tracks.track])
    return Map(p_M, R_MB, tracks.where(keep), tried, inliers, int(np.count_nonzero(~keep)))


def _local_map(
    cameras: tuple[Camera, Camera],
    p_M: Array,
    R_MB: Array,
    recent: Tracks,
    track: Index,
    pose: PoseSettings,
    triangulation: TriangulationSettings,
) -> Array:
    """(m, 3) points of the tracks ``track`` (m,) from the observations ``recent``; NaN where there is none."""
    # Stereo alone sees a point well enough to find a pose by.
    loose = replace(triangulation, parallax_deg=pose.map_parallax_deg, keyframes=1)
    wanted = np.zeros(recent.n_tracks, dtype=bool)
    wanted[track] = True
    points = np.full((recent.n_tracks, 3), np.nan)
    points[wanted] = triangulate(cameras, p_M, R_MB, recent.renumbered(wanted), loose).points_W
    return points[track]


def _body_pose(pose: CameraPose, camera: Camera) -> tuple[Array, Array]:
    """R_MB and p_M of the body from the pose of its camera."""
    R_MB = pose.R_CM.T @ camera.R_BC.T
    return R_MB, -pose.R_CM.T @ pose.p_CM - R_MB @ camera.p_BC
