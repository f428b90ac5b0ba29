"""An estimate without a truth, against the exact truth of a rendered flight."""

from dataclasses import replace

import numpy as np
import pytest

import vigauge as vg
from vigauge.covariance.consistency import GroupChiSquare
from vigauge.recordings.estimation.estimate import NoiseFit, _doubts, _with_walks
from vigauge.recordings.estimation.truth import compare_with_truths


def test_motion_and_biases_are_near_the_truth(made: vg.recordings.Estimate, rendered) -> None:
    """A frame, sign or clock that is wrong between reader, front-end and solver."""
    (found,) = compare_with_truths(rendered.sequence, made.state, made.t_ns)
    assert found.p_rmse_m < 0.006 and found.phi_rmse_deg < 0.4 and found.v_rmse_mps < 0.02
    # Biases are 0.08 rad/s and 0.15 m/s^2. Patches that are only shifted leave 1e-3 rad/s.
    assert np.abs(found.gyro_bias_error).max() < 5e-4
    assert np.abs(found.accel_bias_error).max() < 0.08


def test_truth_of_another_flight_is_far_off(made: vg.recordings.Estimate, rendered) -> None:
    """A comparison that says the same whatever the truth is."""
    still = replace(made.state, p_W=np.zeros_like(made.state.p_W))
    (found,) = compare_with_truths(rendered.sequence, still, made.t_ns)
    assert found.p_rmse_m > 0.2


def test_without_a_truth_nothing_is_compared(made: vg.recordings.Estimate) -> None:
    assert made.truths == ()


def test_noise_fits_the_images_and_is_never_below_the_stated_one(made: vg.recordings.Estimate) -> None:
    """Sigmas of one pixel, which is twice too much, or of six factors' luck."""
    assert made.noise.at_used.visual == pytest.approx(1.0, abs=0.1)
    assert made.noise.at_stated.visual < 0.5 and made.noise.sigma_px < 0.7
    assert made.noise.density_factor >= 1.0


def test_covariance_is_that_of_the_problem_that_is_handed_out(made: vg.recordings.Estimate) -> None:
    """Covariance and problem of different rounds of integration or noise."""
    blocks = vg.Covariance.of(made.problem, made.state).keyframes(vg.FixedGauge())
    np.testing.assert_allclose(made.keyframes, blocks, rtol=1e-6, atol=1e-9 * blocks.max())
    assert not made.sigma[0, :3].any()


@pytest.mark.parametrize(
    ("visual", "inertial", "redundancy", "factor", "words"),
    [
        (1.0, 1.0, 100.0, 1.0, []),
        (1.0, 0.2, 100.0, 1.0, []),
        (4.0, 1.0, 100.0, 1.0, ["image residuals"]),
        (0.2, 9.0, 100.0, 1.0, ["image residuals", "inertial residuals"]),
        (1.0, 2.5, 6.0, 1.0, []),
        (1.0, 2.5, 6.0, 4.0, ["densities 4 times"]),
    ],
)
def test_chi_squares_outside_their_band_are_warned_of(
    visual: float, inertial: float, redundancy: float, factor: float, words: list[str]
) -> None:
    """Sigmas that the residuals contradict, without a word; or a warning of six residuals' luck."""
    used = GroupChiSquare(visual, inertial, 1000.0, redundancy)
    stated = GroupChiSquare(visual, inertial * factor**2, 1000.0, redundancy)
    found = _doubts(NoiseFit(1.0, factor, stated, used))
    assert len(found) == len(words)
    assert all(word in text for word, text in zip(words, found, strict=True))


def test_random_walks_that_are_not_stated_are_replaced_with_a_warning(rendered) -> None:
    """A refusal by the model, deep inside, of sensors whose calibration has densities alone."""
    sequence = rendered.sequence
    assert _with_walks(sequence) == (sequence, [])
    bare = replace(sequence, imu_noise=replace(sequence.imu_noise, gyro_walk=0.0))
    with_walk, (warning,) = _with_walks(bare)
    assert with_walk.imu_noise.gyro_walk > 0.0
    assert with_walk.imu_noise.accel_walk == sequence.imu_noise.accel_walk
    assert "gyro_walk" in warning and "accel_walk" not in warning
