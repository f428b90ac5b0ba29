"""Landmarks of Section IV-A: on several planes, or random along the trajectory.

Every landmark is drawn on a random viewing ray of the trajectory, so that the camera sees
it from somewhere; the two layouts differ in where on the ray it lies.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..errors import DataError
from ..geometry.camera import Camera
from ..geometry.so3 import Array
from .settings import SimulationSettings
from .spline import SplineTrajectory

# Planes n . X = d in W, metres, for a camera that looks along +x from near the origin: a
# wall ahead, one behind, two side walls and a floor; far enough out to hold all three trajectories.
PLANES = (
    (np.array([1.0, 0.0, 0.0]), 8.0),
    (np.array([-1.0, 0.0, 0.0]), 4.0),
    (np.array([0.0, 1.0, 0.0]), 4.5),
    (np.array([0.0, -1.0, 0.0]), 3.0),
    (np.array([0.0, 0.0, -1.0]), 1.5),
)


def _viewing_rays(
    trajectory: SplineTrajectory,
    camera: Camera,
    settings: SimulationSettings,
    rng: np.random.Generator,
    count: int,
) -> tuple[Array, Array]:
    """Origins (count, 3) and directions (count, 3), unit depth along the optical axis, in W."""
    t = rng.uniform(0.0, settings.duration_s, count)
    u = rng.uniform(0.0, camera.width, count)
    v = rng.uniform(0.0, camera.height, count)
    ray_C = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(count)], axis=1)
    R_WC = trajectory.R_WB(t) @ camera.R_BC
    origin = trajectory.p_W(t) + np.einsum("mij,j->mi", trajectory.R_WB(t), camera.p_BC)
    return origin, np.einsum("mij,mj->mi", R_WC, ray_C)


def _random_depths(
    origin: Array, ray: Array, settings: SimulationSettings, rng: np.random.Generator
) -> Array:
    near, far = settings.landmark_depth_m
    return origin + ray * rng.uniform(near, far, len(ray))[:, None]


def _on_planes(origin: Array, ray: Array, settings: SimulationSettings, rng: np.random.Generator) -> Array:
    """First plane that each ray meets, with some roughness along the plane's normal."""
    depth = np.full((len(PLANES), len(ray)), np.inf)
    for row, (normal, offset) in enumerate(PLANES):
        approach = ray @ normal
        distance = offset - origin @ normal
        hits = (approach > 1e-6) & (distance > 0.0)
        depth[row, hits] = distance[hits] / approach[hits]
    plane = np.argmin(depth, axis=0)
    normals = np.array([normal for normal, _ in PLANES])[plane]
    roughness = rng.normal(0.0, settings.plane_roughness_m, len(ray))[:, None]
    return origin + ray * np.min(depth, axis=0)[:, None] + normals * roughness


_LAYOUTS: dict[str, Callable[..., Array]] = {"plane": _on_planes, "random": _random_depths}
LAYOUTS = tuple(_LAYOUTS)


def draw_landmarks(
    layout: str,
    trajectory: SplineTrajectory,
    camera: Camera,
    settings: SimulationSettings,
    rng: np.random.Generator,
    count: int,
) -> Array:
    """(count, 3) landmarks in W, metres. Raises DataError for an unknown layout."""
    if layout not in _LAYOUTS:
        raise DataError("simulation", f"must be one of {', '.join(LAYOUTS)}", field="points", value=layout)
    origin, ray = _viewing_rays(trajectory, camera, settings, rng, count)
    return _LAYOUTS[layout](origin, ray, settings, rng)
