"""Keyframe poses one after the other, by PnP against the points that the keyframes nearby see.

Poses are in the frame M of the map: the body at the first keyframe.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...errors import DataError
from ...geometry.camera import Camera, ideal_size
from ...geometry.so3 import Array
from .epipolar import length_of_step, relative_pose
from .pnp import CameraPose, estimate_pose
from .settings import PoseSettings, TriangulationSettings
from .tracks import LEFT, Index, Tracks
from .triangulation import triangulate


@dataclass(frozen=True)
class Map:
    """Poses by PnP and what they left of the tracks."""

    # (N, 3) m, (N, 3, 3) body poses.
    p_M: Array
    R_MB: Array
    tracks: Tracks  # the observations without those that PnP refused
    # (N,) points of the map seen at each keyframe, and those that agreed; the first keyframe defines the map
    # and has none.
    tried: Index
    inliers: Index
    n_refused: int  # observations that PnP refused


def pose_keyframes(
    cameras: tuple[Camera, ...],
    tracks: Tracks,
    n_keyframes: int,
    pose: PoseSettings,
    triangulation: TriangulationSettings,
    start: Mapping[int, tuple[Array, Array]] | None = None,
) -> Map:
    """Poses of all keyframes by PnP RANSAC of the left camera.

    The points for it are triangulated from the ``pose.map_keyframes`` posed keyframes nearest in order,
    which are the last ones, and from more where fewer than ``pose.sure_inliers`` agree.
    A map that keeps its points for good gives a somewhat better start, but refuses
    observations for disagreeing with the map's own old errors, and what it leaves is biased
    towards the start. ``start`` are (p_M, R_MB) of keyframes that are posed already; None: the first, at
    the origin.

    Raises DataError where a keyframe sees too few points of the map or too few of them agree on a pose.
    """
    p_M, R_MB = np.zeros((n_keyframes, 3)), np.tile(np.eye(3), (n_keyframes, 1, 1))
    tried, inliers = np.zeros(n_keyframes, dtype=np.int64), np.zeros(n_keyframes, dtype=np.int64)
    keep = np.ones(len(tracks.track), dtype=bool)
    start = {0: (np.zeros(3), np.eye(3))} if start is None else start
    posed = np.zeros(n_keyframes, dtype=bool)
    for k, (p, R) in start.items():
        p_M[k], R_MB[k], posed[k] = p, R, True
    waiting = [k for k in range(n_keyframes) if k not in start]
    while waiting:
        # From the posed ones outwards, in order of time; one that fails waits until others give it points.
        there = np.flatnonzero(posed)
        for k in sorted(waiting, key=lambda k: (int(np.abs(there - k).min()), k)):
            attempt = _best_attempt(cameras, p_M, R_MB, tracks.where(keep), posed, k, pose, triangulation)
            tried[k], inliers[k] = len(attempt.track), attempt.n_inliers
            if attempt.found is not None and inliers[k] >= pose.inliers:
                break
        else:
            k = waiting[0]
            rule = (
                f"at least {pose.inliers} points of the map must agree on its pose ({tried[k]} seen, by "
                "keyframes before and after): keyframes that are closer in time, or a window that ends "
                "before it, would do"
            )
            raise DataError("front-end", rule, row=k, field="keyframe", value=int(inliers[k]))
        waiting.remove(k)
        posed[k] = True
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


def _best_attempt(
    cameras: tuple[Camera, ...],
    p_M: Array,
    R_MB: Array,
    tracks: Tracks,
    posed: NDArray[np.bool_],
    k: int,
    pose: PoseSettings,
    triangulation: TriangulationSettings,
) -> _Attempt:
    """The attempt at keyframe k with most inliers: against the posed keyframes nearest in order, then more.

    A few points can agree on a wrong pose, so the map grows until ``pose.sure_inliers`` agree, and
    then each posed keyframe is tried by matches alone.
    """
    nearest = sorted(np.flatnonzero(posed), key=lambda other: (abs(other - k), other))
    best: _Attempt | None = None
    for reach in range(min(pose.map_keyframes, len(nearest)), len(nearest) + 1):
        recent = tracks.where(np.isin(tracks.keyframe, nearest[:reach]))
        attempt = _pose_against(cameras, p_M, R_MB, tracks, recent, k, pose, triangulation)
        if best is None or attempt.n_inliers > best.n_inliers:
            best = attempt
        if best.n_inliers >= pose.sure_inliers:
            return best
    assert best is not None
    points = triangulate(cameras, p_M, R_MB, recent, _loose(pose, triangulation)).points_W
    beside = [_pose_beside(cameras[LEFT], p_M, R_MB, points, tracks, int(j), k, pose) for j in nearest]
    return max([best, *beside], key=lambda attempt: attempt.n_inliers)


def _loose(pose: PoseSettings, triangulation: TriangulationSettings) -> TriangulationSettings:
    """Stereo alone sees a point well enough to find a pose by."""
    return replace(triangulation, parallax_deg=pose.map_parallax_deg, keyframes=1)


def _pose_beside(
    camera: Camera,
    p_M: Array,
    R_MB: Array,
    points_M: Array,
    tracks: Tracks,
    j: int,
    k: int,
    pose: PoseSettings,
) -> _Attempt:
    """Pose of the left camera at keyframe k from that of keyframe j by the matches between the two."""
    (_, track_j, uv_j), (_, track_k, uv_k) = tracks.seen_at(j, LEFT), tracks.seen_at(k, LEFT)
    track, at_j, at_k = np.intersect1d(track_j, track_k, assume_unique=True, return_indices=True)
    uv_j, uv_k = uv_j[at_j], uv_k[at_k]
    step = relative_pose(uv_j, uv_k, camera.K, pose.reprojection_px)
    if step is None:
        return _Attempt(None, track)
    R, t, agree = step
    R_CM = (R_MB[j] @ camera.R_BC).T
    p_CM = -R_CM @ (p_M[j] + R_MB[j] @ camera.p_BC)
    length = length_of_step(R, t, points_M[track[agree]] @ R_CM.T + p_CM, uv_k[agree], camera.K)
    if length is None:
        return _Attempt(None, track)
    return _Attempt(CameraPose(R @ R_CM, R @ p_CM + length * t, agree), track)


def _pose_against(
    cameras: tuple[Camera, ...],
    p_M: Array,
    R_MB: Array,
    tracks: Tracks,
    recent: Tracks,
    k: int,
    pose: PoseSettings,
    triangulation: TriangulationSettings,
) -> _Attempt:
    """Pose of the left camera at keyframe k from the points that the observations ``recent`` give."""
    _, track, uv = tracks.seen_at(k, LEFT)
    wanted = np.zeros(tracks.n_tracks, dtype=bool)
    wanted[track] = True
    points = np.full((tracks.n_tracks, 3), np.nan)
    points[wanted] = triangulate(
        cameras, p_M, R_MB, recent.renumbered(wanted), _loose(pose, triangulation)
    ).points_W
    known = np.isfinite(points[track, 0])
    track, uv = track[known], uv[known]
    K, size = cameras[LEFT].K, ideal_size(cameras[LEFT], uv)
    found = estimate_pose(points[track], uv, K, pose.reprojection_px, pose.rounds, pose.seed, size)
    return _Attempt(found, track)


def _body_pose(pose: CameraPose, camera: Camera) -> tuple[Array, Array]:
    """R_MB and p_M of the body from the pose of its camera."""
    R_MB = pose.R_CM.T @ camera.R_BC.T
    return R_MB, -pose.R_CM.T @ pose.p_CM - R_MB @ camera.p_BC
