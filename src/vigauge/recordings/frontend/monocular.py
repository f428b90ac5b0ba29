"""Keyframe poses and points from one camera, up to a scale that images cannot tell.

Two keyframes far enough apart make a map whose unit is the distance between them; the others are posed
against it one after the other; a bundle adjustment without inertial data then takes the drift out. This gives
the camera's poses in units of the map: the inertial sensor tells the scale (``recordings.alignment``).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...errors import DataError
from ...geometry.camera import Camera, ideal_size
from ...geometry.so3 import Array
from ...model.problem import InertialFactors, Problem
from ...model.state import State
from .epipolar import relative_pose
from .mapping import Map, pose_keyframes
from .outliers import find_inliers
from .settings import OutlierSettings, PoseSettings, TriangulationSettings
from .tracks import LEFT, Tracks
from .triangulation import triangulate

# Of a first pair: rays of its matches, in the median, must meet at this angle. Below, its map is flat.
_LEAST_PARALLAX_DEG, _LEAST_MATCHES = 2.0, 30
# Depths are in units of the first pair's distance; parallax tells what a point is worth.
_LEAST_DEPTH, _LARGEST_DEPTH = 1e-3, 1e6
_PIXEL = 1.0


def pose_up_to_scale(
    camera: Camera,
    tracks: Tracks,
    n_keyframes: int,
    pose: PoseSettings,
    triangulation: TriangulationSettings,
    outliers: OutlierSettings,
) -> Map:
    """Poses of the camera itself, (N, 3) in units of the map, and of the body's axes, (N, 3, 3).

    ``Map.p_M`` are positions of the camera, not of the body: the lever between them is in metres. The first
    keyframe is at the origin with ``R_MB`` the identity.

    Raises DataError where no two keyframes see enough points from places far enough apart, or one cannot be
    posed.
    """
    at_camera = replace(camera, p_BC=np.zeros(3))
    loose = replace(triangulation, least_depth_m=_LEAST_DEPTH, largest_depth_m=_LARGEST_DEPTH)
    # Without a second camera, points need keyframes apart: all that are posed serve.
    everything = replace(pose, map_keyframes=n_keyframes)
    start = _first_pair(at_camera, tracks, n_keyframes, pose)
    mapped = pose_keyframes((at_camera,), tracks, n_keyframes, everything, loose, start)
    return _adjusted(at_camera, mapped, loose, outliers)


def _first_pair(
    camera: Camera, tracks: Tracks, n_keyframes: int, pose: PoseSettings
) -> dict[int, tuple[Array, Array]]:
    """Poses of the two keyframes that most points are seen from at an angle, one unit apart."""
    best: tuple[float, dict[int, tuple[Array, Array]]] = (0.0, {})
    for i in sorted({0, n_keyframes // 3, 2 * n_keyframes // 3}):
        for j in range(i + 1, n_keyframes):
            points, R, t = _pair(camera, tracks, i, j, pose)
            if points > best[0]:
                # x_j = R x_i + t in the cameras' axes; the body's are R_BC away.
                R_BjBi = camera.R_BC @ R @ camera.R_BC.T
                p_j = -R_BjBi.T @ camera.R_BC @ t
                best = points, {i: (np.zeros(3), np.eye(3)), j: (p_j, R_BjBi.T)}
    if not best[1]:
        rule = (
            f"two keyframes must see {_LEAST_MATCHES} points at {_LEAST_PARALLAX_DEG:g} degrees: one camera "
            "that hardly moves, or only turns, tells no depths; a longer window or a second camera would do"
        )
        raise DataError("front-end", rule, field="keyframe")
    return best[1]


def _pair(camera: Camera, tracks: Tracks, i: int, j: int, pose: PoseSettings) -> tuple[float, Array, Array]:
    """How good a first pair two keyframes are (0: none), and R, t of x_j = R x_i + t with unit t.

    It is the number of their matches times the sine of the median angle between their rays, within reason.
    """
    none = 0.0, np.eye(3), np.zeros(3)
    (_, track_i, uv_i), (_, track_j, uv_j) = tracks.seen_at(i, LEFT), tracks.seen_at(j, LEFT)
    _, at_i, at_j = np.intersect1d(track_i, track_j, assume_unique=True, return_indices=True)
    if len(at_i) < _LEAST_MATCHES:
        return none
    uv_i, uv_j = uv_i[at_i], uv_j[at_j]
    found = relative_pose(uv_i, uv_j, camera.K, pose.reprojection_px)
    if found is None or np.count_nonzero(found[2]) < _LEAST_MATCHES:
        return none
    R, t, agree = found
    rays_i, rays_j = (_rays(camera, uv[agree]) for uv in (uv_i, uv_j))
    angle = np.degrees(np.arccos(np.clip(np.sum((rays_i @ R.T) * rays_j, axis=1), -1.0, 1.0)))
    median = float(np.median(angle))
    if median < _LEAST_PARALLAX_DEG:
        return none
    return len(angle) * min(median, 10.0), R, t


def _rays(camera: Camera, uv: Array) -> Array:
    rays = np.column_stack([uv, np.ones(len(uv))]) @ np.linalg.inv(camera.K).T
    return rays / np.linalg.norm(rays, axis=1)[:, None]


def _adjusted(
    camera: Camera, mapped: Map, triangulation: TriangulationSettings, outliers: OutlierSettings
) -> Map:
    """The map after bundle adjustment and without its outliers, first keyframe at the origin."""
    found = triangulate((camera,), mapped.p_M, mapped.R_MB, mapped.tracks, triangulation)
    kept = mapped.tracks.where(found.used).of_tracks(found.good)
    numbered = kept.renumbered(found.good)
    n = len(mapped.p_M)
    problem = Problem.from_observations(
        initial=State.start(mapped.p_M, mapped.R_MB, np.zeros((n, 3)), found.points_W[found.good]),
        cameras=(camera,),
        keyframe=numbered.keyframe,
        camera=numbered.camera,
        landmark=numbered.track,
        uv=numbered.uv,
        sigma_px=_PIXEL,
        inertial=InertialFactors.chain([]),
        gravity=0.0,
        obs_noise=ideal_size(camera, numbered.uv),
    )
    inliers = find_inliers(problem, outliers, triangulation.keyframes)
    R_BM, p_0 = inliers.state.R_WB[0].T, inliers.state.p_W[0]
    return replace(
        mapped,
        p_M=(inliers.state.p_W - p_0) @ R_BM.T,
        R_MB=R_BM @ inliers.state.R_WB,
        tracks=kept.where(inliers.observation),
        n_refused=mapped.n_refused + int(np.count_nonzero(~inliers.observation)),
    )
