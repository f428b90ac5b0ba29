"""Inertial factors with known biases."""

import numpy as np
import pytest

from vigauge.errors import DataError
from vigauge.model.imu import ImuNoise, ImuSamples
from vigauge.recordings.asl.ground_truth import GroundTruth
from vigauge.recordings.frontend.inertial import KnownBiases, check_gaps, inertial_factors

START_NS = 1403636580763555584
NOISE = ImuNoise(1.7e-4, 2e-3)
KEYFRAMES_NS = START_NS + np.array([500_000_000, 700_000_000, 1_000_000_000])


def truth(gyro: np.ndarray | None, accel: np.ndarray | None) -> GroundTruth:
    n = 40
    t_ns = START_NS + np.arange(n, dtype=np.int64) * 50_000_000 + 128  # off the camera's stamps by rounding
    eye = np.tile(np.eye(3), (n, 1, 1))
    return GroundTruth(t_ns, np.zeros((n, 3)), eye, np.zeros((n, 3)), gyro, accel, "truth")


def samples() -> ImuSamples:
    t_ns = START_NS + np.arange(401, dtype=np.int64) * 5_000_000
    return ImuSamples(t_ns, np.tile([0.1, 0.2, 0.3], (401, 1)), np.tile([0.0, 1.0, 9.8], (401, 1)))


ROWS = np.arange(40)[:, None] * [1e-3, 0.0, 0.0]


def test_each_interval_has_the_bias_of_its_middle() -> None:
    """One bias for all, or that of the wrong end of the interval."""
    biases = KnownBiases(truth(ROWS, 2.0 * ROWS), "per_interval", int(KEYFRAMES_NS[0]))
    for start, end, row in ((0.5, 0.7, 12), (0.7, 1.0, 17)):
        gyro, accel = biases.between(START_NS + round(start * 1e9), START_NS + round(end * 1e9))
        assert gyro[0] == pytest.approx(row * 1e-3) and accel[0] == pytest.approx(2e-3 * row)


def test_constant_bias_is_that_of_the_first_keyframe() -> None:
    """The first row of the file, which may lie far before the window."""
    biases = KnownBiases(truth(ROWS, ROWS), "constant", int(KEYFRAMES_NS[0]))
    for interval in ((0, 1), (10**9, 2 * 10**9)):
        assert biases.between(*(START_NS + t for t in interval))[0][0] == pytest.approx(10e-3)


def test_biases_are_taken_off_before_integrating() -> None:
    """A bias added instead of taken off."""
    bias = np.tile([0.1, 0.2, 0.3], (40, 1)), np.tile([0.0, 1.0, 0.0], (40, 1))
    factors = inertial_factors(
        samples(), NOISE, KEYFRAMES_NS, KnownBiases(truth(*bias), "per_interval", int(KEYFRAMES_NS[0]))
    )
    np.testing.assert_allclose(factors.dt, [0.2, 0.3])
    np.testing.assert_allclose(factors.dR, np.tile(np.eye(3), (2, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(factors.dv, np.outer([0.2, 0.3], [0.0, 0.0, 9.8]), atol=1e-9)
    np.testing.assert_array_equal(factors.second - factors.first, 1)


def test_truth_without_biases_is_refused() -> None:
    """Eight columns taken for biases of zero."""
    with pytest.raises(DataError, match="bias"):
        KnownBiases(truth(None, None), "per_interval", START_NS)


def test_truth_that_does_not_reach_the_window_is_refused() -> None:
    """The last row's bias carried on without end."""
    biases = KnownBiases(truth(ROWS, ROWS), "per_interval", START_NS)
    with pytest.raises(DataError, match="truth"):
        biases.between(START_NS + 5 * 10**9, START_NS + 6 * 10**9)
    with pytest.raises(DataError, match="truth"):
        KnownBiases(truth(ROWS, ROWS), "constant", START_NS + 5 * 10**9)


def test_gap_is_refused_inside_the_window_only() -> None:
    """Motion that was not measured, integrated as a straight line; or a gap elsewhere that does no harm."""
    imu = samples()
    lost = np.ones(401, dtype=bool)
    lost[150:160] = False
    gap = ImuSamples(imu.t_ns[lost], imu.gyro[lost], imu.accel[lost])
    with pytest.raises(DataError, match=rf"{imu.t_ns[149]} ns") as caught:
        check_gaps(gap, int(KEYFRAMES_NS[0]), int(KEYFRAMES_NS[-1]), 0.02)
    assert caught.value.value == pytest.approx(0.055)
    check_gaps(gap, int(KEYFRAMES_NS[0]), int(KEYFRAMES_NS[1]), 0.02)
    check_gaps(imu, int(KEYFRAMES_NS[0]), int(KEYFRAMES_NS[-1]), 0.02)
