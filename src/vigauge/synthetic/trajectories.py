"""The three 6-DoF trajectories of Section IV-A: sine, arc and rec.

The body frame is the camera's (z forward, y down), as the paper assumes. Each path is
sampled, joined by a B-spline and run at constant mean speed; the view turns with the path by
a share that is a setting, and sways so that all six degrees of freedom are excited.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..errors import DataError
from ..geometry import so3
from ..geometry.so3 import Array
from .settings import SimulationSettings
from .spline import SplineTrajectory

# Camera axes in W when it looks along +x with z up: right = -y, down = -z, forward = +x.
LOOK_ALONG_X = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])

# Spline knots a second: enough for the shapes, coarse enough to round the corners of rec.
SAMPLES_PER_SECOND = 12


def _resample(path: Array, length_m: float, count: int) -> Array:
    """``count`` points at equal distances along a dense path, scaled to ``length_m``."""
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    wanted = np.linspace(0.0, along[-1], count)
    points = np.stack([np.interp(wanted, along, path[:, axis]) for axis in range(3)], axis=1)
    return (points - points[0]) * (length_m / along[-1])


def _sine_path() -> Array:
    """Two waves along x, with a slower one in height."""
    x = np.linspace(0.0, 5.0, 4000)
    return np.stack([x, 0.35 * np.sin(2.0 * np.pi * x / 2.5), 0.15 * np.sin(2.0 * np.pi * x / 5.0)], axis=1)


def _arc_path() -> Array:
    """A bit more than a half circle about the vertical, rising gently."""
    angle = np.linspace(0.0, np.radians(200.0), 4000)
    radius = 1.4
    return np.stack([radius * np.sin(angle), radius * (1.0 - np.cos(angle)), 0.1 * angle], axis=1)


def _rec_path() -> Array:
    """Once round a rectangle with rounded corners, tilted so that height changes too."""
    corners = np.array([[0.0, 0.0], [0.0, 1.5], [-1.0, 1.5], [-1.0, 0.0], [0.0, 0.0]])
    dense = _resample(np.column_stack([corners, 0.1 * corners[:, 1]]), 5.0, 4000)
    # A moving average as wide as the corner radius; the ends repeat so that the path keeps them.
    width = 320
    padded = np.concatenate([np.repeat(dense[:1], width, 0), dense, np.repeat(dense[-1:], width, 0)])
    kernel = np.hanning(2 * width + 1)
    kernel /= kernel.sum()
    return np.stack([np.convolve(padded[:, axis], kernel, mode="valid") for axis in range(3)], axis=1)


_PATHS: dict[str, Callable[[], Array]] = {"sine": _sine_path, "arc": _arc_path, "rec": _rec_path}
TRAJECTORIES = tuple(_PATHS)


def _sway(t: Array, duration: float, amplitude: float) -> Array:
    """Rotation vectors (M, 3) of the view about its mean: three incommensurate slow waves."""
    cycles = 2.0 * np.pi * t[:, None] / duration * np.array([1.3, 0.9, 1.1])
    return amplitude * np.sin(cycles + np.array([0.3, 1.1, 2.0])) * np.array([0.6, 1.0, 0.5])


def _heading(points: Array) -> Array:
    """(M,) direction of the horizontal motion at each point, radians about z, without jumps."""
    motion = np.gradient(points, axis=0)
    return np.unwrap(np.arctan2(motion[:, 1], motion[:, 0]))


def make_trajectory(shape: str, settings: SimulationSettings) -> SplineTrajectory:
    """Trajectory ``shape`` of the given duration and mean speed.

    Raises DataError for an unknown shape.
    """
    if shape not in _PATHS:
        raise DataError(
            "simulation", f"must be one of {', '.join(TRAJECTORIES)}", field="trajectory", value=shape
        )
    count = max(12, round(SAMPLES_PER_SECOND * settings.duration_s))
    t = np.linspace(0.0, settings.duration_s, count)
    points = _resample(_PATHS[shape](), settings.path_length_m, count)
    sway = _sway(t, settings.duration_s, np.radians(settings.rotation_amplitude_deg))
    heading = _heading(points)
    middle = 0.5 * (heading.min() + heading.max())
    # The view's yaw is taken about the middle of its range, where the rotation vector is shortest;
    # about z in W is about -y of the body, which looks ahead with y down.
    turn = settings.view_follows_path * (heading - middle)
    rotation = sway - turn[:, None] * np.array([0.0, 1.0, 0.0])
    reference = so3.yaw_rotation(settings.view_follows_path * middle) @ LOOK_ALONG_X
    return SplineTrajectory.through(t, points, rotation, reference)
