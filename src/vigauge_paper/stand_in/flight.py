"""Smooth flights for rendered sequences, EuRoC's sensors as numbers, and what the inertial one records.

The body frame is that of EuRoC's sensor: x up, y right, z forward, in the direction the
cameras look. World: z up.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vigauge.geometry.camera import EQUIDISTANT, RADIAL_TANGENTIAL, Camera
from vigauge.geometry.so3 import Array
from vigauge.model.imu import ImuNoise, ImuSamples
from vigauge.synthetic.spline import SplineTrajectory

_KNOT_SPACING_S = 0.1
# Knots beyond both ends of the wanted span keep the spline's free ends away from it.
_EXTRA_KNOTS = 10

# Body at zero rotation vector: x_B = z_W (up), z_B = x_W (forward), y_B = z_B x x_B = -y_W.
R_WB_LEVEL = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])

# EuRoC, cam0/sensor.yaml, cam1/sensor.yaml: intrinsics px, distortion, rows of T_BS (m).
_EUROC_SIZE = (752, 480)
_EUROC_CAMERAS = (
    (
        (458.654, 457.296, 367.215, 248.375),
        (-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05),
        (
            (0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975),
            (0.999557249008, 0.0149672133247, 0.025715529948, -0.064676986768),
            (-0.0257744366974, 0.00375618835797, 0.999660727178, 0.00981073058949),
        ),
    ),
    (
        (457.587, 456.134, 379.999, 255.238),
        (-0.28368365, 0.07451284, -0.00010473, -3.55590700e-05),
        (
            (0.0125552670891, -0.999755099723, 0.0182237714554, -0.0198435579556),
            (0.999598781151, 0.0130119051815, 0.0251588363115, 0.0453689425024),
            (-0.0253898008918, 0.0179005838253, 0.999517347078, 0.00786212447038),
        ),
    ),
)
# TUM-VI, camchain.yaml of the images of 512 x 512: intrinsics px, distortion of the left and right fisheye.
_TUM_VI_SIZE = (512, 512)
_TUM_VI_LENSES = (
    (
        (190.97847715128717, 190.9733070521226, 254.93170605935475, 256.8974428996504),
        (0.0034823894022493434, 0.0007150348452162257, -0.0020532361418706202, 0.00020293673591811182),
    ),
    (
        (190.44236969414825, 190.4344384721956, 252.59949716835982, 254.91723064636983),
        (0.0034003170790442797, 0.001766278153469831, -0.00266312569781606, 0.0003299517423931039),
    ),
)
# EuRoC, imu0/sensor.yaml: rad/s/sqrt(Hz), m/s^2/sqrt(Hz); random walks rad/s^2/sqrt(Hz), m/s^3/sqrt(Hz).
EUROC_IMU_NOISE = ImuNoise(gyro_density=1.6968e-04, accel_density=2.0e-3)
EUROC_BIAS_WALK = ImuNoise(gyro_density=1.9393e-05, accel_density=3.0e-3)
EUROC_IMU_RATE_HZ = 200
EUROC_CAMERA_RATE_HZ = 20


def euroc_cameras() -> tuple[Camera, Camera]:
    """EuRoC's left and right camera as calibrated in the dataset's ``sensor.yaml``."""
    left, right = (
        Camera(*intrinsics, *_EUROC_SIZE, distortion, np.array(T)[:, :3], np.array(T)[:, 3])
        for intrinsics, distortion, T in _EUROC_CAMERAS
    )
    return left, right


def fisheye_cameras() -> tuple[Camera, Camera]:
    """TUM-VI's fisheyes where EuRoC has its cameras."""
    left, right = (
        Camera(*intrinsics, *_TUM_VI_SIZE, distortion, camera.R_BC, camera.p_BC, EQUIDISTANT)
        for (intrinsics, distortion), camera in zip(_TUM_VI_LENSES, euroc_cameras(), strict=True)
    )
    return left, right


# The rig with each lens that a sequence can be rendered through.
RIGS = {RADIAL_TANGENTIAL: euroc_cameras, EQUIDISTANT: fisheye_cameras}


@dataclass(frozen=True)
class FlightShape:
    """A flight as sums of sines about a mean pose, one row a tone and one column an axis."""

    mean_W: ArrayLike  # (3,) m
    # (tones, 3) amplitude and frequency along x, y, z of W.
    position_m: ArrayLike
    position_hz: ArrayLike
    # (tones, 3) of the rotation vector about up, right, forward.
    rotation_rad: ArrayLike
    rotation_hz: ArrayLike


# Hand-held liveliness on the spot, as before the take-off in MH_01_easy.
HALL_FLIGHT = FlightShape(
    mean_W=(0.0, 0.0, 1.6),
    position_m=((0.60, 0.80, 0.35), (0.06, 0.08, 0.06)),
    position_hz=((0.20, 0.22, 0.25), (0.52, 0.55, 0.60)),
    rotation_rad=((0.35, 0.12, 0.12), (0.05, 0.04, 0.04)),
    rotation_hz=((0.18, 0.28, 0.33), (0.65, 0.75, 0.80)),
)
# A slow survey of the room that turns from side to side.
ROOM_FLIGHT = FlightShape(
    mean_W=(-0.6, 0.0, 1.5),
    position_m=((1.20, 1.50, 0.45), (0.10, 0.10, 0.06)),
    position_hz=((0.11, 0.09, 0.14), (0.45, 0.42, 0.50)),
    rotation_rad=((0.90, 0.10, 0.10), (0.10, 0.05, 0.05)),
    rotation_hz=((0.09, 0.22, 0.27), (0.40, 0.50, 0.55)),
)


def fly(shape: FlightShape, start_s: float, end_s: float, rng: np.random.Generator) -> SplineTrajectory:
    """A B-spline through the shape, valid from ``start_s`` to ``end_s``; phases are random."""
    first = np.floor(start_s / _KNOT_SPACING_S) - _EXTRA_KNOTS
    last = np.ceil(end_s / _KNOT_SPACING_S) + _EXTRA_KNOTS
    t = np.arange(first, last + 1.0) * _KNOT_SPACING_S

    def tones(amplitude: ArrayLike, frequency_hz: ArrayLike) -> Array:
        amplitude, frequency = np.asarray(amplitude), np.asarray(frequency_hz)
        phase = rng.uniform(0.0, 2.0 * np.pi, amplitude.shape)
        angle = 2.0 * np.pi * frequency * t[:, None, None] + phase
        return (amplitude * np.sin(angle)).sum(axis=1)

    p_W = np.asarray(shape.mean_W) + tones(shape.position_m, shape.position_hz)
    phi = tones(shape.rotation_rad, shape.rotation_hz)
    return SplineTrajectory.through(t, p_W, phi, R_WB_LEVEL)


@dataclass(frozen=True)
class ImuRecord:
    """What an inertial sensor recorded, and the biases it had while doing so.

    ``gyro_bias`` (M, 3) rad/s and ``accel_bias`` (M, 3) m/s^2 belong to the rows of ``samples``.
    """

    samples: ImuSamples
    gyro_bias: Array
    accel_bias: Array


def record_imu(
    trajectory: SplineTrajectory,
    t_ns: NDArray[np.int64],
    origin_ns: int,
    gravity: float,
    noise: ImuNoise,
    bias: tuple[ArrayLike, ArrayLike],
    bias_walk: ImuNoise | None,
    rng: np.random.Generator,
) -> ImuRecord:
    """Point samples of angular velocity and specific force, with bias and white noise.

    Parameters
    ----------
    t_ns : (M,) evenly spaced stamps; ``origin_ns`` is the trajectory's t = 0
    gravity : m/s^2
    bias : gyroscope and accelerometer bias at the first sample, (3,) rad/s and m/s^2
    bias_walk : random-walk densities of the biases, or None for constant biases
    """
    t = (t_ns - origin_ns) * 1e-9
    rate_hz = 1e9 / float(t_ns[1] - t_ns[0])
    white = rng.standard_normal((2, len(t), 3))
    steps = rng.standard_normal((2, len(t), 3))
    steps[:, 0] = 0.0
    walk = np.zeros((2, 1, 1))
    if bias_walk is not None:
        walk[:, 0, 0] = bias_walk.gyro_density, bias_walk.accel_density
    drift = walk / np.sqrt(rate_hz) * np.cumsum(steps, axis=1)
    gyro_bias, accel_bias = (np.asarray(bias[k], dtype=float) + drift[k] for k in range(2))
    deviation = np.sqrt(rate_hz) * np.array([noise.gyro_density, noise.accel_density])
    gyro = trajectory.omega_B(t) + gyro_bias + deviation[0] * white[0]
    accel = trajectory.specific_force_B(t, gravity) + accel_bias + deviation[1] * white[1]
    return ImuRecord(ImuSamples(t_ns, gyro, accel), gyro_bias, accel_bias)
