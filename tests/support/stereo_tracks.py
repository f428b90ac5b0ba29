"""Tracks of known points seen by EuRoC's stereo pair from known poses, and images with known shifts."""

from dataclasses import dataclass

import cv2
import numpy as np

from vigauge.geometry import so3
from vigauge.geometry.camera import Camera
from vigauge.recordings.frontend.tracks import Tracks
from vigauge_paper.stand_in.flight import euroc_cameras


@dataclass(frozen=True)
class World:
    """Exact poses (N), points (K, 3) m in the frame of the first body, and ideal pixels."""

    cameras: tuple[Camera, Camera]
    p_M: np.ndarray
    R_MB: np.ndarray
    X_M: np.ndarray
    tracks: Tracks


def pixels(camera: Camera, p_M: np.ndarray, R_MB: np.ndarray, X_M: np.ndarray) -> np.ndarray:
    """Ideal pixels (K, 2) of points, written out plainly; NaN behind the camera or outside the image."""
    points_C = (camera.R_BC.T @ (R_MB.T @ (X_M - p_M).T - camera.p_BC[:, None])).T
    with np.errstate(divide="ignore", invalid="ignore"):
        uv = points_C[:, :2] / points_C[:, 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
    inside = (points_C[:, 2] > 0.1) & np.all((uv >= 0) & (uv <= [camera.width, camera.height]), axis=1)
    return np.where(inside[:, None], uv, np.nan)


def make_world(
    seed: int,
    n_keyframes: int,
    n_points: int,
    depth_m: tuple[float, float] = (1.0, 6.0),
    sigma_px: float = 0.0,
) -> World:
    """A body that drifts and turns in front of points spread over the first view."""
    rng = np.random.default_rng(seed)
    cameras = euroc_cameras()
    step = np.arange(n_keyframes)[:, None]
    p_M = step * [0.02, 0.05, -0.02] + 0.05 * np.sin(step * [0.7, 0.5, 0.9])
    R_MB = so3.exp(0.03 * np.sin(step * [0.6, 0.8, 0.4]))
    left = cameras[0]
    uv = rng.uniform([20, 20], [left.width - 20, left.height - 20], (n_points, 2))
    rays_C = np.column_stack([(uv - [left.cx, left.cy]) / [left.fx, left.fy], np.ones(n_points)])
    X_M = (rng.uniform(*depth_m, n_points)[:, None] * rays_C) @ left.R_BC.T + left.p_BC
    rows = []
    for track in range(n_points):
        for keyframe in range(n_keyframes):
            for index, camera in enumerate(cameras):
                seen = pixels(camera, p_M[keyframe], R_MB[keyframe], X_M[track : track + 1])[0]
                if np.isfinite(seen[0]):
                    rows.append((keyframe, index, track, *seen))
    table = np.array(rows)
    noise = sigma_px * rng.standard_normal((len(table), 2))
    keyframe, index, track = table[:, :3].astype(np.int64).T
    return World(cameras, p_M, R_MB, X_M, Tracks(keyframe, index, track, table[:, 3:] + noise, n_points))


def texture(seed: int, height: int, width: int) -> np.ndarray:
    """A smooth random image, rich in corners and nowhere like elsewhere."""
    noise = np.random.default_rng(seed).standard_normal((height, width)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 1.5)
    return np.clip(128.0 + 60.0 * smooth / smooth.std(), 0.0, 255.0).astype(np.uint8)
