"""Rotations that a camera or a ground truth saw, against those that the gyroscope measured.

Over an interval the gyroscope turns by phi_B, another sensor by phi_S. With clocks that
differ by an offset, axes that differ by a rotation, and a gyroscope with bias b,

    phi_B(t1 + offset, t2 + offset) = A phi_S(t1, t2) + b (t2 - t1).

A is linear here, so one least-squares fit for each offset tells units (its scale), axes
(its rotation) and bias, and the offset with the smallest residual tells the clocks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...geometry import so3
from ...geometry.so3 import Array
from ...model.imu import ImuSamples

# Offsets that are tried: hardware that is triggered together is off by less than a frame.
SEARCH_S, STEP_S = 0.1, 0.005
# Fewer turns do not determine the twelve numbers of a fit with some redundancy.
LEAST_TURNS = 8
# Turns smaller than this, root mean square, drown in the noise of poses (about 1e-3 rad).
LEAST_TURN_RAD = 0.01
# Residuals beyond this many times the median are wrong poses, not noise.
_OUTLIER_FACTOR = 4.0
# Search for them: least absolute errors by weights, with a floor below the noise of any pose.
_COARSE_STEP_S, _REWEIGHTINGS, _FLOOR_RAD = 0.02, 12, 1e-4


@dataclass(frozen=True)
class Turns:
    """Rotations over P intervals."""

    # (P,) int64 ends of the intervals by the clock of the sensor S.
    first_ns: NDArray[np.int64]
    second_ns: NDArray[np.int64]
    phi_S: Array  # (P, 3) rotation vector of R_S1S2, rad
    R_BS: Array  # (3, 3) axes of the sensor in the body frame, as calibrated

    def where(self, keep: NDArray[np.bool_]) -> Turns:
        """Only the intervals ``keep`` (P,)."""
        return Turns(self.first_ns[keep], self.second_ns[keep], self.phi_S[keep], self.R_BS)

    @property
    def rms_rad(self) -> float:
        """Root mean square of the angles; 0 where there is no interval."""
        return float(np.sqrt(np.mean(np.sum(self.phi_S**2, axis=1)))) if len(self.phi_S) else 0.0


class GyroRotation:
    """The gyroscope integrated over its whole record: R_B0Bt at any time in it."""

    def __init__(self, samples: ImuSamples) -> None:
        self.t_ns = samples.t_ns
        h = np.diff(samples.t_ns)[:, None] * 1e-9
        first, second = samples.gyro[:-1], samples.gyro[1:]
        self._steps = 0.5 * h * (first + second) + h**2 / 12.0 * np.cross(first, second)
        R = np.empty((len(samples.t_ns), 3, 3))
        R[0] = np.eye(3)
        for k, step in enumerate(so3.exp(self._steps)):
            np.matmul(R[k], step, out=R[k + 1])
        self._R = R

    def covers(self, t_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(P,) which stamps lie inside the record."""
        return (t_ns >= self.t_ns[0]) & (t_ns <= self.t_ns[-1])

    def at(self, t_ns: NDArray[np.int64]) -> Array:
        """(P, 3, 3) R_B0Bt; the rate is held over the step between two samples."""
        k = np.clip(np.searchsorted(self.t_ns, t_ns, side="right") - 1, 0, len(self.t_ns) - 2)
        share = (t_ns - self.t_ns[k]) / (self.t_ns[k + 1] - self.t_ns[k])
        return self._R[k] @ so3.exp(share[:, None] * self._steps[k])

    def turned(self, first_ns: NDArray[np.int64], second_ns: NDArray[np.int64]) -> Array:
        """(P, 3) rotation vectors of R_B1B2."""
        return so3.log(self.at(first_ns).swapaxes(1, 2) @ self.at(second_ns))


@dataclass(frozen=True)
class TurnFit:
    """What the comparison says."""

    n_turns: int  # intervals used; wrong ones are left out
    offset_s: float  # t_gyro = t_sensor + offset
    offset_sigma_s: float  # its standard deviation; large where the motion does not tell
    scale: float  # size of the gyroscope's turns relative to the sensor's, 1 if both are in radians
    # Angle between the sensor's axes as calibrated and as its turns say; NaN where it turns about one axis
    # only.
    axes_deg: float
    axes_sigma_deg: float  # its standard deviation, by what the fit leaves over
    gyro_bias: Array  # (3,) rad/s, the mean over the record
    rms_rad: float  # residual with the calibrated axes, scale 1, the offset and the bias above


def compare_turns(gyro: GyroRotation, turns: Turns) -> TurnFit | None:
    """Fit the model above; None where there are too few turns, or too small ones, to tell."""
    margin = int(SEARCH_S * 1e9)
    turns = turns.where(gyro.covers(turns.first_ns - margin) & gyro.covers(turns.second_ns + margin))
    if len(turns.phi_S) < LEAST_TURNS or turns.rms_rad < LEAST_TURN_RAD:
        return None
    turns = turns.where(_inliers(gyro, turns))
    if len(turns.phi_S) < LEAST_TURNS or turns.rms_rad < LEAST_TURN_RAD:
        return None
    offset, _ = _best_offset(gyro, turns, free_axes=True)
    A, _, left = _fit(gyro, turns, offset, free_axes=True)
    scale, axes = _scale_and_axes(A, turns)
    axes_deg, axes_sigma_deg = (
        float(np.degrees(x)) for x in (np.linalg.norm(axes), _sigma(axes, turns, left))
    )
    offset, sigma = _best_offset(gyro, turns, free_axes=False)
    _, bias, residual = _fit(gyro, turns, offset, free_axes=False)
    return TurnFit(len(turns.phi_S), offset, sigma, scale, axes_deg, axes_sigma_deg, bias, _rms(residual))


def _rms(residual: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(residual**2, axis=1))))


def _fit(gyro: GyroRotation, turns: Turns, offset_s: float, *, free_axes: bool) -> tuple[Array, Array, Array]:
    """A (3, 3), bias (3,) and residuals (P, 3) of the model at one offset."""
    shift = round(offset_s * 1e9)
    phi_B = gyro.turned(turns.first_ns + shift, turns.second_ns + shift)
    dt = (turns.second_ns - turns.first_ns)[:, None] * 1e-9
    if free_axes:
        design = np.hstack([turns.phi_S, dt])
        solution = np.linalg.lstsq(design, phi_B, rcond=None)[0]
        return solution[:3].T, solution[3], phi_B - design @ solution
    left = phi_B - turns.phi_S @ turns.R_BS.T
    bias = np.sum(left * dt, axis=0) / float(np.sum(dt**2))
    return turns.R_BS, bias, left - bias * dt


def _inliers(gyro: GyroRotation, turns: Turns) -> NDArray[np.bool_]:
    """(P,) turns that the best of all fits of least absolute error explains.

    Squares would let a few wrong poses bend the fit until they look right; and the sensor's turns,
    the ones that may be wrong, are fitted to the gyroscope's, not the other way round. The offsets
    tried are coarse: one that is off by ten milliseconds still tells a wrong pose from a good one.
    """
    dt = (turns.second_ns - turns.first_ns)[:, None] * 1e-9
    best = np.full(len(turns.phi_S), np.inf)
    for offset in np.arange(-SEARCH_S, SEARCH_S + _COARSE_STEP_S / 2.0, _COARSE_STEP_S):
        shift = round(offset * 1e9)
        phi_B = gyro.turned(turns.first_ns + shift, turns.second_ns + shift)
        design, error = np.hstack([phi_B, dt]), np.ones(len(turns.phi_S))
        for _ in range(_REWEIGHTINGS):
            weight = 1.0 / np.sqrt(np.maximum(error, _FLOOR_RAD))[:, None]
            solution = np.linalg.lstsq(weight * design, weight * turns.phi_S, rcond=None)[0]
            error = np.linalg.norm(turns.phi_S - design @ solution, axis=1)
        if np.sum(error) < np.sum(best):
            best = error
    return best <= _OUTLIER_FACTOR * max(float(np.median(best)), _FLOOR_RAD)


def _best_offset(gyro: GyroRotation, turns: Turns, *, free_axes: bool) -> tuple[float, float]:
    """Offset with the least squared residual, to a fraction of a step, and its deviation, s."""
    offsets = np.arange(-SEARCH_S, SEARCH_S + 0.5 * STEP_S, STEP_S)
    cost = np.array([np.sum(_fit(gyro, turns, s, free_axes=free_axes)[2] ** 2) for s in offsets])
    best = int(np.clip(np.argmin(cost), 1, len(offsets) - 2))
    before, here, after = cost[best - 1 : best + 2]
    curvature = before - 2.0 * here + after
    if curvature <= 0.0:
        return float(offsets[best]), float("inf")
    move = float(np.clip(0.5 * (before - after) / curvature, -1.0, 1.0))
    least = here - 0.25 * (before - after) * move
    freedom = max(3 * len(turns.phi_S) - (13 if free_axes else 4), 1)
    # cost = least + curvature / 2 (x / step)^2: the variance of x is a residual's over half of that.
    sigma = STEP_S * float(np.sqrt(2.0 * max(least, 0.0) / freedom / curvature))
    return float(offsets[best] + move * STEP_S), sigma


def _scale_and_axes(A: Array, turns: Turns) -> tuple[float, Array]:
    """Scale of A where the sensor turns, and the rotation vector in B from R_BS to the rotation in A."""
    expected = turns.phi_S @ A.T
    scale = float(np.linalg.norm(expected) / np.linalg.norm(turns.phi_S))
    spread = np.linalg.svd(turns.phi_S, compute_uv=False) / np.sqrt(len(turns.phi_S))
    if spread[1] < LEAST_TURN_RAD / 2.0:
        return scale, np.full(3, np.nan)
    # The rotation that carries the sensor's turns onto the gyroscope's (Wahba, by SVD).
    left, _, right = np.linalg.svd(expected.T @ turns.phi_S)
    R = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    return scale, so3.log(R @ turns.R_BS.T)


def _sigma(axes: Array, turns: Turns, left: Array) -> float:
    """Standard deviation of the length of a rotation vector ``axes``, rad, found beside a constant bias.

    ``left`` (P, 3) is what the fit of free axes leaves over.
    """
    dt = (turns.second_ns - turns.first_ns)[:, None, None] * 1e-9
    by_axes = -so3.hat(turns.phi_S @ turns.R_BS.T)
    J = np.concatenate([by_axes, dt * np.eye(3)], axis=2).reshape(-1, 6)
    information, directions = np.linalg.eigh(J.T @ J)
    along = axes / max(float(np.linalg.norm(axes)), 1e-300) @ directions[:3]
    variance = np.sum(left**2) / max(left.size - 13, 1)
    # Turns that hardly change their axis leave it open along that: next to no information.
    return float(np.sqrt(variance * np.sum(along**2 / np.maximum(information, 1e-30))))
