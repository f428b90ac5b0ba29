"""Landmarks from two or more views with pycolmap, each checked before it is believed.

pycolmap gives points behind cameras and at any angle without complaint, so depth,
parallax and reprojection are judged here, and what is refused is counted by reason.
"""

from __future__ import annotations

# zlib must be loaded before pycolmap: pycolmap brings its own copy, and where that one
# comes first the process aborts when something writes a PNG, a PDF or a compressed npz.
import zlib  # noqa: F401  isort: skip
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

import pycolmap  # isort: skip
from numpy.typing import NDArray

from ...geometry.camera import Camera, ideal_size
from ...geometry.so3 import Array
from .settings import TriangulationSettings
from .stereo import StereoGeometry
from .tracks import Index, Tracks


class Verdict(IntEnum):
    """What became of a track; the value 0 is the only good one."""

    GOOD = 0
    TOO_FEW_VIEWS = 1
    NO_SOLUTION = 2
    DEPTH = 3
    REPROJECTION = 4
    PARALLAX = 5

    @property
    def reason(self) -> str:
        return self.name.lower().replace("_", " ")


@dataclass(frozen=True)
class Triangulation:
    """Result for each of T tracks.

    ``points_W`` (T, 3) m, NaN where the verdict is not good; ``verdict`` (T,) of
    :class:`Verdict`; ``used`` (M,) observations that were not dropped on the way.
    """

    points_W: Array
    verdict: NDArray[np.int64]
    used: NDArray[np.bool_]

    @property
    def good(self) -> NDArray[np.bool_]:
        return self.verdict == Verdict.GOOD

    def rejected(self) -> dict[str, int]:
        """Number of refused tracks by reason."""
        return {v.reason: int(np.count_nonzero(self.verdict == v)) for v in Verdict if v is not Verdict.GOOD}


@dataclass(frozen=True)
class _Views:
    """Each observation's camera: ``R_CW`` (M, 3, 3), ``p_CW`` (M, 3) m, ray in C, calibration (M, 4), and
    ideal pixels to a measured one (M,)."""

    R_CW: Array
    p_CW: Array
    ray_C: Array
    calibration: Array
    size: Array

    @classmethod
    def of(cls, cameras: tuple[Camera, ...], p_W: Array, R_WB: Array, tracks: Tracks) -> _Views:
        R_BC = np.array([c.R_BC for c in cameras])[tracks.camera]
        p_BC = np.array([c.p_BC for c in cameras])[tracks.camera]
        R_WC = R_WB[tracks.keyframe] @ R_BC
        p_WC = p_W[tracks.keyframe] + np.einsum("mij,mj->mi", R_WB[tracks.keyframe], p_BC)
        calibration = np.array([[c.fx, c.fy, c.cx, c.cy] for c in cameras])[tracks.camera]
        ray = np.column_stack(
            [(tracks.uv - calibration[:, 2:]) / calibration[:, :2], np.ones(len(tracks.uv))]
        )
        ray /= np.linalg.norm(ray, axis=1)[:, None]
        R_CW = R_WC.swapaxes(1, 2)
        size = np.ones(len(tracks.uv))
        for index, camera in enumerate(cameras):
            its = tracks.camera == index
            size[its] = ideal_size(camera, tracks.uv[its])
        return cls(R_CW, -np.einsum("mij,mj->mi", R_CW, p_WC), ray, calibration, size)

    def depth_and_error(self, points_W: Array, uv: Array) -> tuple[Array, Array]:
        """Depth (M,) m and reprojection error (M,) of points (M, 3), measured px; infinite behind."""
        points_C = np.einsum("mij,mj->mi", self.R_CW, points_W) + self.p_CW
        depth = points_C[:, 2]
        ahead = depth > 1e-9
        xy = points_C[:, :2] / np.where(ahead, depth, 1.0)[:, None]
        predicted = xy * self.calibration[:, :2] + self.calibration[:, 2:]
        return depth, np.where(ahead, np.linalg.norm(predicted - uv, axis=1) / self.size, np.inf)


def parallax(rays_W: Array, track: Index, n_tracks: int) -> Array:
    """(n_tracks,) largest angle, rad, between any two unit rays (M, 3) of a track."""
    order = np.argsort(track, kind="stable")
    count = np.bincount(track, minlength=n_tracks)
    begin = np.concatenate([[0], np.cumsum(count)[:-1]])
    out = np.zeros(n_tracks)
    for views in np.unique(count[count > 1]):
        members = np.flatnonzero(count == views)
        rays = rays_W[order[begin[members][:, None] + np.arange(views)]]
        # |a - b| keeps the digits that the cosine loses at small angles.
        squared = np.sum((rays[:, :, None, :] - rays[:, None, :, :]) ** 2, axis=-1)
        chord = np.sqrt(squared.max(axis=(1, 2)))
        out[members] = 2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0))
    return out


def triangulate(
    cameras: tuple[Camera, ...], p_W: Array, R_WB: Array, tracks: Tracks, settings: TriangulationSettings
) -> Triangulation:
    """Triangulate every track from all its views.

    Parameters
    ----------
    p_W, R_WB : (N, 3) m and (N, 3, 3) body poses of the keyframes
    tracks : observations, ordered by track; at most two views of a track that disagree with
        the others by more than ``settings.reprojection_px`` are dropped, the worst first

    A point is refused where a depth is outside the given range, the error of a view is too
    large, or the largest angle between its rays is too small.
    """
    views = _Views.of(cameras, p_W, R_WB, tracks)
    used = np.ones(len(tracks.track), dtype=bool)
    points = np.full((tracks.n_tracks, 3), np.nan)
    todo = np.ones(tracks.n_tracks, dtype=bool)
    for _ in range(3):
        _solve(views, tracks, used, todo, points)
        worst, error = _worst_view(views, tracks, used, points)
        # A drop must leave the views that a landmark needs.
        bad = (error > settings.reprojection_px) & (
            np.bincount(tracks.track[used], minlength=tracks.n_tracks) > 2
        )
        if not np.any(bad):
            break
        used[worst[bad]] = False
        todo = bad
    verdict = _judge(views, tracks, used, points, settings)
    points[verdict != Verdict.GOOD] = np.nan
    return Triangulation(points, verdict, used)


def _solve(
    views: _Views, tracks: Tracks, used: NDArray[np.bool_], todo: NDArray[np.bool_], points: Array
) -> None:
    """Fill in the points of the tracks ``todo`` from the views ``used``."""
    T_CW = np.concatenate([views.R_CW, views.p_CW[:, :, None]], axis=2)
    rows = np.flatnonzero(used & todo[tracks.track])
    points[todo] = np.nan
    if not len(rows):
        return
    for group in np.split(rows, np.flatnonzero(np.diff(tracks.track[rows])) + 1):
        if len(group) < 2:
            continue
        point = pycolmap.triangulate_multi_view_point(list(T_CW[group]), views.ray_C[group])
        if point is not None:
            points[tracks.track[group[0]]] = np.ravel(point)


def _worst_view(
    views: _Views, tracks: Tracks, used: NDArray[np.bool_], points: Array
) -> tuple[NDArray[np.int64], Array]:
    """Row and error (px) of the worst used view of each track; error 0 where there is none."""
    with np.errstate(invalid="ignore"):
        _, error = views.depth_and_error(points[tracks.track], tracks.uv)
    error = np.where(used & np.isfinite(points[tracks.track, 0]), error, -1.0)
    largest = np.zeros(tracks.n_tracks)
    np.maximum.at(largest, tracks.track, error)
    row = np.zeros(tracks.n_tracks, dtype=np.int64)
    is_worst = error == largest[tracks.track]
    row[tracks.track[is_worst]] = np.flatnonzero(is_worst)
    return row, largest


def _judge(
    views: _Views, tracks: Tracks, used: NDArray[np.bool_], points: Array, settings: TriangulationSettings
) -> NDArray[np.int64]:
    """(T,) verdicts; where several reasons hold, the first of the enumeration counts."""
    n, track = tracks.n_tracks, tracks.track[used]
    solved = np.isfinite(points[:, 0])
    with np.errstate(invalid="ignore"):
        depth, error = views.depth_and_error(points[tracks.track], tracks.uv)
    shallowest, deepest, largest = np.full(n, np.inf), np.full(n, -np.inf), np.zeros(n)
    np.fmin.at(shallowest, track, depth[used])
    np.fmax.at(deepest, track, depth[used])
    np.fmax.at(largest, track, error[used])
    rays_W = np.einsum("mji,mj->mi", views.R_CW[used], views.ray_C[used])
    angle = parallax(rays_W, track, n)
    too_few = np.bincount(track, minlength=n) < 2
    too_few |= tracks.where(used).keyframes_per_track() < settings.keyframes
    verdict = np.full(n, int(Verdict.GOOD))
    for reason, refused in (
        (Verdict.PARALLAX, angle < np.radians(settings.parallax_deg)),
        (Verdict.REPROJECTION, largest > settings.reprojection_px),
        (Verdict.DEPTH, (shallowest < settings.least_depth_m) | (deepest > settings.largest_depth_m)),
        (Verdict.NO_SOLUTION, ~solved),
        (Verdict.TOO_FEW_VIEWS, too_few),
    ):
        verdict[refused] = int(reason)
    return verdict


def triangulate_pair(geometry: StereoGeometry, uv_left: Array, uv_right: Array) -> Array:
    """Points (M, 3), m, in the left camera from one stereo view, ideal pixels (M, 2) each.

    NaN where the point is behind a camera. No other check: a stereo view alone has little
    parallax, and who uses these points knows that.
    """
    m = len(uv_left)
    T_CL = [np.eye(3, 4), np.column_stack([geometry.R_RL, geometry.p_RL])]
    rays = np.ones((m, 2, 3))
    for view, (uv, camera) in enumerate(((uv_left, geometry.left), (uv_right, geometry.right))):
        rays[:, view, :2] = (uv - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    rays /= np.linalg.norm(rays, axis=2)[:, :, None]
    points = np.full((m, 3), np.nan)
    for k in range(m):
        point = pycolmap.triangulate_multi_view_point(T_CL, rays[k])
        if point is not None:
            points[k] = np.ravel(point)
    with np.errstate(invalid="ignore"):
        ahead = (points[:, 2] > 0.0) & ((points @ geometry.R_RL.T + geometry.p_RL)[:, 2] > 0.0)
    points[~ahead] = np.nan
    return points
