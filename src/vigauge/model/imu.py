"""Inertial samples and their preintegration between keyframes (Forster et al., the paper's [5]).

The samples are points of a continuous signal, so they are joined linearly: rotations by
a fourth-order Magnus step, forces by the integrals of a straight line. Euler steps would
be wrong by several sigma at 200 Hz.

Noise follows the white-noise density convention: a sample taken at rate f has standard
deviation density * sqrt(f). Every sample's share in the three increments is kept, also
that it enters two steps, so the covariance of each factor is exact to first order. That
neighbouring factors share the sample between them is left out.

Biases are taken off the samples before. Where they are estimated, the increments follow a change of
them to first order, and each keyframe's bias is the one before plus a step of a random walk, whose share
in the increments of its own interval is kept too.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..arrays import instance, integer, integers, number, reals, shape_of, vectors
from ..errors import DataError
from ..geometry import so3
from ..geometry.so3 import Array

# A gap is a step this many times the median.
_LARGEST_GAP = 10.0
# No inertial sensor is faster than 33 kHz; stamps in micro- or milliseconds would look like it.
_SHORTEST_PERIOD_S = 3e-5


@dataclass(frozen=True)
class ImuNoise:
    """White-noise densities: gyro in rad/s/sqrt(Hz), accel in m/s^2/sqrt(Hz).

    ``gyro_walk`` (rad/s^2/sqrt(Hz)) and ``accel_walk`` (m/s^3/sqrt(Hz)) are those of the biases' random walk:
    over t seconds a bias moves by walk * sqrt(t). Zero: the biases are constant.
    """

    gyro_density: float
    accel_density: float
    gyro_walk: float = 0.0
    accel_walk: float = 0.0

    def __post_init__(self) -> None:
        for name in ("gyro_density", "accel_density", "gyro_walk", "accel_walk"):
            if number("imu noise", getattr(self, name), field=name) < 0.0:
                raise DataError("imu noise", "must not be negative", field=name, value=getattr(self, name))

    def scaled(self, factor: float) -> ImuNoise:
        """All densities times ``factor``; DataError where it is not positive."""
        factor = number("imu noise", factor, field="factor", above=0.0)
        return ImuNoise(
            self.gyro_density * factor,
            self.accel_density * factor,
            self.gyro_walk * factor,
            self.accel_walk * factor,
        )


@dataclass(frozen=True)
class ImuSamples:
    """Inertial samples in the body frame.

    Attributes
    ----------
    t_ns : (M,) int64, strictly increasing, nanoseconds
    gyro : (M, 3) angular velocity, rad/s
    accel : (M, 3) specific force, m/s^2

    Raises DataError for stamps that are no integers or do not increase, other shapes, or numbers that
    are not finite.
    """

    t_ns: NDArray[np.int64]
    gyro: Array
    accel: Array

    def __post_init__(self) -> None:
        shape_of("imu", self.t_ns, field="timestamp")
        t_ns = np.asarray(self.t_ns)
        if t_ns.dtype.kind == "f" and t_ns.size:
            rule = "must be integer nanoseconds; of seconds, np.round(t * 1e9).astype(np.int64)"
            raise DataError("imu", rule, field="timestamp", value=str(t_ns.dtype))
        object.__setattr__(self, "t_ns", integers("imu", t_ns, ("M",), field="timestamp"))
        for name in ("gyro", "accel"):
            array = reals("imu", getattr(self, name), (len(self.t_ns), 3), field=name)
            object.__setattr__(self, name, array)
        step = np.diff(self.t_ns)
        if np.any(step <= 0):
            row = int(np.argmax(step <= 0)) + 1
            value = int(self.t_ns[row - 1]), int(self.t_ns[row])
            rule = "must increase strictly; sort the samples and drop repeated stamps"
            raise DataError("imu", rule, field="timestamp", row=row, value=value)

    def corrected(self, gyro_bias: Array, accel_bias: Array) -> ImuSamples:
        """Samples with known biases taken off; each bias is (3,) or (M, 3)."""
        gyro_bias, accel_bias = (
            vectors("imu", bias, len(self.t_ns), field=name)
            for name, bias in (("gyro_bias", gyro_bias), ("accel_bias", accel_bias))
        )
        return ImuSamples(self.t_ns, self.gyro - gyro_bias, self.accel - accel_bias)

    def period(self) -> float:
        """Median time between samples, seconds."""
        return float(np.median(np.diff(self.t_ns))) * 1e-9


@dataclass(frozen=True)
class Preintegrated:
    """Increments over one interval in the body frame at its start, and their covariance.

    Attributes
    ----------
    dt : length, s
    dp : (3,) m;  dR : (3, 3);  dv : (3,) m/s
    covariance : (9, 9), order (dp, rotation vector right of dR, dv)
    by_gyro_bias, by_accel_bias : (9, 3) first-order change of (dp, rotation vector right of dR, dv) for a
        bias larger by one unit (rad/s, m/s^2) than the one taken off (Forster et al., Eq. 44)
    walk_covariance : (15, 15), what the random walk of the biases adds, order (dp, rotation vector right of
        dR, dv, gyroscope bias at the end less that at the start, accelerometer bias likewise)
    """

    dt: float
    dp: Array
    dR: Array
    dv: Array
    covariance: Array
    by_gyro_bias: Array = field(default_factory=lambda: np.zeros((9, 3)))
    by_accel_bias: Array = field(default_factory=lambda: np.zeros((9, 3)))
    walk_covariance: Array = field(default_factory=lambda: np.zeros((15, 15)))


def _nodes(samples: ImuSamples, t_start_ns: int, t_end_ns: int) -> tuple[Array, Array]:
    """Node times (s from the start) and the weights (nodes, samples) of linear interpolation."""
    if t_end_ns <= t_start_ns:
        raise DataError("imu", "interval must have positive length", value=(t_start_ns, t_end_ns))
    t = samples.t_ns
    if len(t) < 2 or t_start_ns < t[0] or t_end_ns > t[-1]:
        span = (int(t[0]), int(t[-1])) if len(t) else ()
        raise DataError(
            "imu",
            f"samples must cover the interval {t_start_ns}..{t_end_ns} ns",
            field="timestamp",
            value=span,
        )
    inside = t[(t > t_start_ns) & (t < t_end_ns)]
    node_ns = np.concatenate([[t_start_ns], inside, [t_end_ns]])
    right = np.clip(np.searchsorted(t, node_ns, side="left"), 1, len(t) - 1)
    fraction = (node_ns - t[right - 1]) / (t[right] - t[right - 1])
    first = right[0] - 1
    weights = np.zeros((len(node_ns), right[-1] - first + 1))
    rows = np.arange(len(node_ns))
    weights[rows, right - 1 - first] = 1.0 - fraction
    weights[rows, right - first] += fraction
    full = np.zeros((len(node_ns), len(t)))
    full[:, first : right[-1] + 1] = weights
    return (node_ns - t_start_ns) * 1e-9, full


def _require_dense(samples: ImuSamples, lo: int, hi: int, largest_gap_s: float | None) -> None:
    """DataError where samples lo..hi have a gap, or where all come faster than any sensor's."""
    period = samples.period()
    if period < _SHORTEST_PERIOD_S:
        rule = f"must be nanoseconds: samples every {period:.1e} s are faster than any sensor's"
        raise DataError("imu", rule, field="timestamp", value=int(samples.t_ns[0]))
    largest = _LARGEST_GAP * period
    if largest_gap_s is not None:
        largest = number("largest_gap_s", largest_gap_s, above=0.0)
    gap = np.diff(samples.t_ns[lo:hi]) * 1e-9
    if gap.max() > largest * (1.0 + 1e-9):
        row = int(np.argmax(gap))
        rule = f"gap between samples must not exceed {largest:g} s; largest_gap_s allows a larger one"
        raise DataError("imu", rule, field="timestamp", row=lo + row, value=float(gap[row]))


def _accumulate_rotations(steps: Array) -> Array:
    """(M + 1, 3, 3) running products, starting at the identity, of the (M, 3, 3) steps."""
    running = np.empty((len(steps) + 1, 3, 3))
    running[0] = np.eye(3)
    for k, step in enumerate(steps):
        np.matmul(running[k], step, out=running[k + 1])
    return running


def preintegrate(
    samples: ImuSamples,
    t_start_ns: int,
    t_end_ns: int,
    noise: ImuNoise,
    *,
    biases: tuple[Array, Array] | None = None,
    largest_gap_s: float | None = None,
) -> Preintegrated:
    """Preintegrate bias-corrected samples from ``t_start_ns`` to ``t_end_ns``.

    ``biases``: (gyroscope, accelerometer), (3,) each, to take off the samples before.

    ``largest_gap_s``: time between two samples that is still bridged by a straight line, by default ten
    times the median.

    Raises
    ------
    DataError
        where the samples do not cover the interval or have a larger gap in it, or where stamps are no
        integer nanoseconds.
    """
    instance("samples", samples, ImuSamples)
    instance("noise", noise, ImuNoise)
    if biases is not None and len(instance("biases", biases, tuple)) != 2:
        raise DataError("biases", "must be two, of the gyroscope and the accelerometer", value=len(biases))
    t_start_ns, t_end_ns = integer("t_start_ns", t_start_ns), integer("t_end_ns", t_end_ns)
    lo = max(int(np.searchsorted(samples.t_ns, t_start_ns, side="right")) - 1, 0)
    hi = int(np.searchsorted(samples.t_ns, t_end_ns, side="left")) + 1
    window = ImuSamples(samples.t_ns[lo:hi], samples.gyro[lo:hi], samples.accel[lo:hi])
    if biases is not None:
        window = window.corrected(*biases)
    time, weights = _nodes(window, t_start_ns, t_end_ns)
    _require_dense(samples, lo, hi, largest_gap_s)
    gyro, accel = weights @ window.gyro, weights @ window.accel
    h = np.diff(time)[:, None]

    mean_rate = 0.5 * (gyro[:-1] + gyro[1:])
    turn = h * mean_rate + h**2 / 12.0 * np.cross(gyro[:-1], gyro[1:])
    rotation = _accumulate_rotations(so3.exp(turn))
    force = np.einsum("kij,kj->ki", rotation, accel)  # in the frame at the start
    dv_steps = h * 0.5 * (force[:-1] + force[1:])
    dv = np.concatenate([np.zeros((1, 3)), np.cumsum(dv_steps, axis=0)])
    dp_steps = h * dv[:-1] + h**2 / 6.0 * (2.0 * force[:-1] + force[1:])
    dp = np.concatenate([np.zeros((1, 3)), np.cumsum(dp_steps, axis=0)])

    by_rate, by_force = _noise_shares(time, rotation, turn, force, dp, dv)
    # A step's rate is the mean of its two nodes; nodes are means of samples.
    sampled = [
        np.einsum("kij,ks->sij", by_rate, 0.5 * (weights[:-1] + weights[1:])) * noise.gyro_density,
        np.einsum("kij,ks->sij", by_force, weights) * noise.accel_density,
    ]
    share = np.concatenate(sampled, axis=2) / np.sqrt(samples.period())
    covariance = np.einsum("sij,skj->ik", share, share)
    by_bias, walk = _bias_shares(h, gyro, by_rate, by_force, noise)
    return Preintegrated(
        float(time[-1]), dp[-1], rotation[-1], dv[-1], covariance, by_bias[:, :3], by_bias[:, 3:], walk
    )


def _bias_shares(
    h: Array, gyro: Array, by_rate: Array, by_force: Array, noise: ImuNoise
) -> tuple[Array, Array]:
    """Effect of a change of both biases (9, 6), and the covariance (15, 15) that their walk adds.

    A bias shifts all samples alike, also within the commutator of a step. What a walk's change during one
    step does is what a bias does to all steps after it and to half of its own.
    """
    rates = -by_rate @ (np.eye(3) - h[:, :, None] / 12.0 * so3.hat(gyro[1:] - gyro[:-1]))
    by_bias = np.concatenate([rates.sum(axis=0), -by_force.sum(axis=0)], axis=1)
    if not (noise.gyro_walk or noise.accel_walk):
        return by_bias, np.zeros((15, 15))
    forces = -0.5 * (by_force[:-1] + by_force[1:])
    forces[-1] -= 0.5 * by_force[-1]
    later = [np.cumsum(effect[::-1], axis=0)[::-1] - 0.5 * effect for effect in (rates, forces)]
    root = np.sqrt(h[:, :, None]) * np.repeat([noise.gyro_walk, noise.accel_walk], 3)
    unit = np.broadcast_to(np.eye(6), (len(h), 6, 6))
    share = np.concatenate([np.concatenate(later, axis=2), unit], axis=1) * root
    return by_bias, np.einsum("kij,klj->il", share, share)


def _noise_shares(
    time: Array, rotation: Array, turn: Array, force: Array, dp: Array, dv: Array
) -> tuple[Array, Array]:
    """Effects on (dp, dphi, dv) at the end: of each step's rate error (M, 9, 3), and of each
    node's force error (M + 1, 9, 3).

    In the frame at the start a rotation error stays constant, so what a rate error does
    to velocity and position is a cross product with what is still to be accumulated. That
    includes half of its own step, whose force at the end is turned already.
    """
    h = np.diff(time)[:, None]
    left = (time[-1] - time[1:])[:, None]  # time still to go after each step
    tilt = rotation[1:] @ so3.right_jacobian(turn) * h[:, :, None]
    velocity_to_come = dv[-1] - dv[1:] + 0.5 * h * force[1:]
    position_to_come = dp[-1] - dp[1:] - dv[1:] * left + h * (h / 6.0 + 0.5 * left) * force[1:]
    by_rate = np.concatenate(
        [-so3.hat(position_to_come) @ tilt, rotation[-1].T @ tilt, -so3.hat(velocity_to_come) @ tilt], axis=1
    )
    velocity_weight, position_weight = np.zeros((2, len(time), 1))
    velocity_weight[:-1] += 0.5 * h
    velocity_weight[1:] += 0.5 * h
    position_weight[:-1] += h * (h / 3.0 + 0.5 * left)
    position_weight[1:] += h * (h / 6.0 + 0.5 * left)
    by_force = np.zeros((len(time), 9, 3))
    by_force[:, 0:3] = position_weight[:, :, None] * rotation
    by_force[:, 6:9] = velocity_weight[:, :, None] * rotation
    return by_rate, by_force
