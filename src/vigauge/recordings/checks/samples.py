"""The samples of the inertial sensor piece by piece: gaps, bursts, values that stand still."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...geometry.so3 import Array
from ...model.imu import ImuSamples
from .findings import Findings
from .stamps import check_bursts, check_imu_gaps

# So many equal samples in a row, at the largest or smallest value of an axis, are a flat top: noise never
# makes them, where the axis moves over so many of its smallest steps.
_FLAT_SAMPLES, _LEAST_STEPS = 4, 20
# All six values the same so many times: the sensor, or its driver, hangs.
_HANGING_SAMPLES = 10


def check_samples(samples: ImuSamples, first_ns: int, last_ns: int, out: Findings) -> None:
    """Gaps, bursts, flat tops and hanging values between two stamps."""
    check_imu_gaps(samples.t_ns, first_ns, last_ns, out)
    inside = (samples.t_ns >= first_ns) & (samples.t_ns <= last_ns)
    t_ns = samples.t_ns[inside]
    if len(t_ns) < 2:
        return
    check_bursts(t_ns, out)
    for name, values in (("gyroscope", samples.gyro[inside]), ("accelerometer", samples.accel[inside])):
        for axis in range(3):
            _check_flat(f"the {name}'s {'xyz'[axis]} axis", t_ns, values[:, axis], out)
    values = np.hstack([samples.gyro, samples.accel])[inside]
    starts, lengths = _runs(np.all(values[1:] == values[:-1], axis=1))
    hanging = np.flatnonzero(lengths + 1 >= _HANGING_SAMPLES)
    if len(hanging):
        k = hanging[0]
        out.error(
            "imu hangs",
            f"imu0 repeats all six values {lengths[k] + 1} times from {t_ns[starts[k]]} ns on, "
            f"{len(hanging)} time(s) in all: choose a window without that",
        )


def _runs(true: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Start and length of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]])))
    return edges[::2], edges[1::2] - edges[::2]


def _check_flat(axis: str, t_ns: NDArray[np.int64], values: Array, out: Findings) -> None:
    """Values (M,) of one axis that stand at their largest or smallest: the sensor saturates there."""
    steps = np.diff(np.unique(values))
    if not len(steps) or np.ptp(values) < _LEAST_STEPS * float(np.min(steps)):
        return
    for extreme in (values.max(), values.min()):
        starts, lengths = _runs(values == extreme)
        flat = lengths >= _FLAT_SAMPLES
        if not np.any(flat):
            continue
        k = int(np.argmax(flat))
        out.error(
            "saturated",
            f"{axis} stands at {extreme:.4g} for {lengths[flat].sum()} samples in {np.count_nonzero(flat)} "
            f"piece(s), first from {t_ns[starts[k]]} ns for {lengths[k]} samples: it saturates, and what it "
            "did not measure cannot be integrated. Choose a window without that, or a larger range",
        )
