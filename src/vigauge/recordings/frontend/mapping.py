"""Keyframe poses one after the other, by PnP against the points that the keyframes just before see.

Poses are in the frame M of the map: the body at the first keyframe.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...errors import DataError
from ...geometry.camera import Camera
from ...geometry.so3 import Array
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
    p_M, R_MB = np.zeros((n_keyframes, 3)), np.tile(np.eye(3), (n_keyframes, 1, 1))
    tried, inliers = np.zeros(n_keyframes, dtype=np.int64), np.zeros(n_keyframes, dtype=np.int64)
    keep = np.ones(len(tracks.track), dtype=bool)
    for k in range(1, n_keyframes):
        # Where the last keyframes share too little with this one, those before them may help.
        for reach in range(min(pose.map_keyframes, k), k + 1):
            recent = tracks.where(keep & (tracks.keyframe < k) & (tracks.keyframe >= k - reach))
            attempt = _pose_against(cameras, p_M, R_MB, tracks, recent, k, pose, triangulation)
            tried[k], inliers[k] = len(attempt.track), attempt.n_inliers
            if inliers[k] >= pose.inliers:
                break
        if attempt.found is None or inliers[k] < pose.inliers:
            rule = f"at least {pose.inliers} points of the map must agree on its pose ({tried[k]} seen)"
            raise DataError("front-end", rule, row=k, field="keyframe", value=int(inliers[k]))
        R_MB[k], p_M[k] = _body_pose(attempt.found, cameras[LEFT])
        wrong = np.zeros(tracks.n_tracks, dtype=bool)
        wrong[attempt.track[~attempt.found.inlier]] = True
        keep &= ~((tracks.keyframe == k) & wrong[tracks.track])
    return Map(p_M, R_MB, tracks.where(keep), tried, inliers, int(np.count_nonzero(~keep)))


@dataclass(frozen=True)
class _Attempt:
    """A pose, or None, and the tracks (m,) of the points that were tried for it."""

    found: CameraPose | None
    track: Index

    @property
    def n_inliers(self) -> int:
        return self.found.n_inliers if self.found else 0


def _pose_against(
    cameras: tuple[Camera, Camera],
    p_M: Array,
    R_MB: Array,
    tracks: Tracks,
    recent: Tracks,
    k: int,
    pose: PoseSettings,
    triangulation: TriangulationSettings,
) -> _Attempt:
    """Pose of the left camera at keyframe k from the points that the observations ``recent`` give."""
    # Stereo alone sees a point well enough to find a pose by.
    loose = replace(triangulation, parallax_deg=pose.map_parallax_deg, keyframes=1)
    _, track, uv = tracks.seen_at(k, LEFT)
    wanted = np.zeros(tracks.n_tracks, dtype=bool)
    wanted[track] = True
    points = np.full((tracks.n_tracks, 3), np.nan)
    points[wanted] = triangulate(cameras, p_M, R_MB, recent.renumbered(wanted), loose).points_W
    known = np.isfinite(points[track, 0])
    track, uv = track[known], uv[known]
    K = cameras[LEFT].K
    return _Attempt(estimate_pose(points[track], uv, K, pose.reprojection_px, pose.rounds), track)


def _body_pose(pose: CameraPose, camera: Camera) -> tuple[Array, Array]:
    """R_MB and p_M of the body from the pose of its camera."""
    R_MB = pose.R_CM.T @ camera.R_BC.T
    return R_MB, -pose.R_CM.T @ pose.p_CM - R_MB @ camera.p_BC
