"""Inertial factors between keyframes, with biases taken off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import DataError
from ...geometry.so3 import Array
from ...model.imu import ImuNoise, ImuSamples, Preintegrated, preintegrate
from ...model.problem import InertialFactors
from ..asl.ground_truth import GroundTruth

# Known biases move slowly; a truth row this near an instant speaks for it.
_BIAS_REACH_NS = 100_000_000
# The front-end's own setting says which gaps it allows, see check_gaps.
ANY_GAP_S = 1e9


class KnownBiases:
    """Biases of a ground truth.

    Parameters
    ----------
    truth : must have biases
    mode : "per_interval": of the row nearest the middle of an interval; "constant": of the
        row nearest ``first_ns``, for all

    Raises DataError where the truth has no biases or does not reach ``first_ns``.
    """

    def __init__(self, truth: GroundTruth, mode: str, first_ns: int) -> None:
        if truth.gyro_bias is None or truth.accel_bias is None:
            raise DataError(
                truth.source, "must have bias columns to take biases from (17 columns)", field="b_w"
            )
        self.truth = truth
        self.gyro, self.accel = truth.gyro_bias, truth.accel_bias
        self.constant = int(truth.nearest([first_ns], _BIAS_REACH_NS)[0]) if mode == "constant" else None

    def between(self, start_ns: int, end_ns: int) -> tuple[Array, Array]:
        """Gyroscope (3,) rad/s and accelerometer (3,) m/s^2 bias of an interval."""
        row = self.constant
        if row is None:
            row = int(self.truth.nearest([start_ns + (end_ns - start_ns) // 2], _BIAS_REACH_NS)[0])
        return self.gyro[row], self.accel[row]


@dataclass(frozen=True)
class ConstantBiases:
    """One pair for all: ``gyro`` (3,) rad/s and ``accel`` (3,) m/s^2."""

    gyro: Array
    accel: Array

    def between(self, start_ns: int, end_ns: int) -> tuple[Array, Array]:
        """As that of :class:`KnownBiases`."""
        return self.gyro, self.accel


Biases = KnownBiases | ConstantBiases


def check_gaps(imu: ImuSamples, start_ns: int, end_ns: int, largest_gap_s: float) -> None:
    """Refuse samples with a gap inside start..end: what was not measured cannot be integrated.

    Raises DataError naming the stamp before the gap and its length.
    """
    begin = max(int(np.searchsorted(imu.t_ns, start_ns, side="right")) - 1, 0)
    end = int(np.searchsorted(imu.t_ns, end_ns, side="left")) + 1
    gaps = np.diff(imu.t_ns[begin:end]) * 1e-9
    if np.any(gaps > largest_gap_s):
        k = int(np.argmax(gaps > largest_gap_s))
        rule = (
            f"gap between samples must not exceed {largest_gap_s:g} s (it follows {imu.t_ns[begin + k]} ns)"
        )
        raise DataError("imu", rule, row=begin + k, field="timestamp", value=float(gaps[k]))


def preintegrate_between(
    imu: ImuSamples, noise: ImuNoise, stamps_ns: NDArray[np.int64], biases: Biases
) -> list[Preintegrated]:
    """One factor from each stamp to the next, biases taken off.

    Raises DataError where samples or biases do not cover an interval.
    """
    factors = []
    for start, end in zip(stamps_ns[:-1].tolist(), stamps_ns[1:].tolist(), strict=True):
        corrected = imu.corrected(*biases.between(start, end))
        factors.append(preintegrate(corrected, start, end, noise, largest_gap_s=ANY_GAP_S))
    return factors


def inertial_factors(
    imu: ImuSamples,
    noise: ImuNoise,
    stamps_ns: NDArray[np.int64],
    biases: Biases,
    start: ConstantBiases | None = None,
) -> InertialFactors:
    """The chain of factors over keyframe stamps (N,).

    ``start``: the biases, where they are to be estimated; the noise must then have their random walk.
    """
    factors = preintegrate_between(imu, noise, stamps_ns, biases)
    return (
        InertialFactors.chain(factors, start.gyro, start.accel) if start else InertialFactors.chain(factors)
    )
