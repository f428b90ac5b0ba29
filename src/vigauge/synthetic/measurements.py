"""What the sensors report: inertial samples from the spline, image points from the pinhole."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..geometry.camera import Camera, project
from ..geometry.so3 import Array
from ..model.imu import ImuNoise, ImuSamples
from .spline import SplineTrajectory

# Nearer than this a point is not imaged, metres.
MINIMUM_DEPTH = 0.3


def ideal_imu(trajectory: SplineTrajectory, t_ns: NDArray[np.int64], gravity: float) -> ImuSamples:
    """Noise-free samples at integer nanoseconds from the start of the trajectory."""
    t = t_ns * 1e-9
    return ImuSamples(t_ns, trajectory.omega_B(t), trajectory.specific_force_B(t, gravity))


def random_walk(begin: object, walk: float, t_ns: NDArray[np.int64], rng: np.random.Generator) -> Array:
    """(M, 3) a bias at the stamps: ``begin`` (3,) at the first, then steps of deviation walk * sqrt(time)."""
    step = np.sqrt(np.diff(t_ns, prepend=t_ns[0]) * 1e-9)[:, None]
    return np.array(begin) + walk * np.cumsum(step * rng.normal(size=(len(step), 3)), axis=0)


def corrupt_imu(
    ideal: ImuSamples, noise: ImuNoise, gyro_bias: Array, accel_bias: Array, rng: np.random.Generator
) -> ImuSamples:
    """Samples with biases, (3,) or one a sample, and white noise (density times square root of the rate)."""
    root_rate = 1.0 / np.sqrt(ideal.period())
    gyro = ideal.gyro + gyro_bias + rng.normal(0.0, noise.gyro_density * root_rate, ideal.gyro.shape)
    accel = ideal.accel + accel_bias + rng.normal(0.0, noise.accel_density * root_rate, ideal.accel.shape)
    return ImuSamples(ideal.t_ns, gyro, accel)


def visible_points(
    p_W: Array, R_WB: Array, camera: Camera, X_W: Array
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Exact images of all landmarks in all keyframes.

    Returns (keyframe, landmark, pixels (M, 2)) of what lies in front of the camera and inside the image.
    """
    R_WC = R_WB @ camera.R_BC
    centre_W = p_W + R_WB @ camera.p_BC
    points_C = np.einsum("nji,nkj->nki", R_WC, X_W[None] - centre_W[:, None])
    keyframe, landmark = np.nonzero(points_C[..., 2] > MINIMUM_DEPTH)
    uv, _ = project(points_C[keyframe, landmark], camera.fx, camera.fy, camera.cx, camera.cy)
    inside = np.all((uv >= 0.0) & (uv <= [camera.width - 1, camera.height - 1]), axis=1)
    return keyframe[inside], landmark[inside], uv[inside]
