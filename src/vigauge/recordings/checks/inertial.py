"""The inertial sensor by itself: rest, gravity, units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...geometry.so3 import Array
from ...model.imu import ImuNoise, ImuSamples
from ..asl.calibration import unusual_densities
from .findings import Findings
from .turning import GyroRotation

# Gravity at rest, m/s^2, with any accelerometer bias that is worth using: 9.78..9.83 on Earth.
GRAVITY_MPS2 = (8.0, 11.0)
# Half a second is short enough to find pauses. Averages over a twentieth take out the shaking of motors
# that idle, which is faster than any motion of a vehicle.
_BLOCK_S, _AVERAGE_S = 0.5, 0.05
# Deviation of these averages within a block: rad/s, and share of gravity. On the ground with idling motors
# EuRoC's sensor has up to 0.011 and 0.013, held in the hand 0.06 and 0.023 at least.
_REST_RATE_RADPS, _REST_FORCE_SHARE = 0.02, 0.02
# Over blocks of this length the mean acceleration of a vehicle is small beside gravity.
_MOTION_BLOCK_S = 2.0
# In their quietest 40 samples EuRoC's sensors scatter by 0.5 to 1.9 times the published densities. Users of
# Kalibr inflate densities by 10; degrees for radians are 57.
_QUIET_SAMPLES, _NOISE_FACTOR = 40, 25.0


@dataclass(frozen=True)
class Rest:
    """``share`` of half-second blocks in which nothing moves; of each the mean rate and force (B, 3), SI."""

    share: float
    rate_B: Array
    force_B: Array

    @property
    def gyro_bias(self) -> Array | None:
        """(3,) rad/s: what the gyroscope reads at rest; None without rest."""
        return np.median(self.rate_B, axis=0) if len(self.rate_B) else None


def _blocks(values: Array, length: int) -> Array:
    """(B, length, 3) of (M, 3) consecutive rows; the last ones are left out."""
    n = len(values) // length
    return values[: n * length].reshape(n, length, 3)


def check_noise(noise: ImuNoise, samples: ImuSamples, out: Findings) -> None:
    """Noise densities against what is usual, and against the scatter of the quietest samples."""
    for sentence in unusual_densities(noise):
        out.warn("noise", sentence)
    for name, values, stated in (
        ("gyroscope", samples.gyro, noise.gyro_density),
        ("accelerometer", samples.accel, noise.accel_density),
    ):
        # Second differences of white noise of variance 1 have variance 6; motion and bias fall out of them.
        scatter = _blocks(np.diff(values, n=2, axis=0) / np.sqrt(6.0), _QUIET_SAMPLES).std(axis=1)
        found = float(scatter.min(initial=np.inf) * np.sqrt(samples.period()))
        out.fact("imu0", **{f"{name}_scatter_density": found})
        # Repeated or rounded samples do not scatter at all.
        if np.isfinite(found) and found > 0.0 and not 1.0 / _NOISE_FACTOR <= stated / found <= _NOISE_FACTOR:
            out.warn(
                "noise",
                f"{name}_noise_density is {stated:.3g}, but the quietest samples scatter by {found:.3g}, "
                f"{max(stated / found, found / stated):.0f} times as "
                f"{'little' if stated > found else 'much'}: another unit, or not this sensor's",
            )


def find_rest(samples: ImuSamples) -> Rest:
    """Blocks in which rate and force stay constant; a constant rate is a bias."""
    short = max(round(_AVERAGE_S / samples.period()), 1)
    gyro, accel = (_blocks(values, short).mean(axis=1) for values in (samples.gyro, samples.accel))
    gyro, accel = (_blocks(values, round(_BLOCK_S / _AVERAGE_S)) for values in (gyro, accel))
    if not len(gyro):
        return Rest(0.0, np.empty((0, 3)), np.empty((0, 3)))
    mean = accel.mean(axis=1)
    quiet = np.linalg.norm(gyro.std(axis=1), axis=1) < _REST_RATE_RADPS
    quiet &= np.linalg.norm(accel.std(axis=1), axis=1) < _REST_FORCE_SHARE * np.linalg.norm(mean, axis=1)
    return Rest(float(np.mean(quiet)), gyro.mean(axis=1)[quiet], mean[quiet])


def moving_gravity(samples: ImuSamples, gyro_bias: Array) -> float:
    """Length of the mean force, m/s^2, turned by the gyroscope into the axes at the start of each block.

    Median over blocks; NaN where the record is shorter than one.
    """
    length = round(_MOTION_BLOCK_S / samples.period())
    if len(samples.t_ns) < max(length, 2):
        return float("nan")
    R = GyroRotation(samples.corrected(gyro_bias, np.zeros(3))).at(samples.t_ns)
    force = _blocks(np.einsum("mij,mj->mi", R, samples.accel), length)
    return float(np.median(np.linalg.norm(force.mean(axis=1), axis=1)))


def check_gravity(samples: ImuSamples, rest: Rest, gyro_bias: Array, out: Findings) -> None:
    """Specific force against gravity: at rest where there is rest, else averaged over the motion."""
    at_rest = bool(len(rest.force_B))
    if at_rest:
        gravity = float(np.median(np.linalg.norm(rest.force_B, axis=1)))
    else:
        gravity = moving_gravity(samples, gyro_bias)
    how = "at rest" if at_rest else "averaged in motion"
    out.fact("imu0", rest_share=rest.share, gravity_mps2=gravity, gravity_found=how)
    out.fact("imu0", largest_rate_radps=float(np.abs(samples.gyro).max()))
    if not np.isnan(gravity) and not GRAVITY_MPS2[0] <= gravity <= GRAVITY_MPS2[1]:
        message = (
            f"specific force {how} is {gravity:.3g} m/s^2, expected {GRAVITY_MPS2[0]:g} to "
            f"{GRAVITY_MPS2[1]:g}: accelerometer in g, wrong scale, or columns exchanged"
        )
        (out.error if at_rest else out.warn)("gravity", message)
