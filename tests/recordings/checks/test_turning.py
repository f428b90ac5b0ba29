"""Turns against the gyroscope: clocks, axes, units and bias come out as they were put in."""

from dataclasses import replace

import numpy as np
import pytest

from vigauge.geometry import so3
from vigauge.model.imu import ImuSamples
from vigauge.recordings.checks.findings import Findings
from vigauge.recordings.checks.truth import _judge_turns
from vigauge.recordings.checks.turning import GyroRotation, Turns, compare_turns

START_NS = 1_403_636_580_763_555_584
BIAS = np.array([-0.003, 0.02, 0.08])


def rate(t: np.ndarray) -> np.ndarray:
    """(M, 3) rad/s of a lively motion about all axes."""
    return np.stack([np.sin(2.1 * t), 0.7 * np.cos(3.3 * t + 1.0), 0.5 * np.sin(5.0 * t + 2.0)], axis=1)


def samples(scale: float = 1.0, bias: np.ndarray = BIAS) -> ImuSamples:
    t_ns = START_NS + 5_000_000 * np.arange(2001)
    gyro = scale * rate((t_ns - START_NS) * 1e-9) + bias
    return ImuSamples(t_ns, gyro, np.tile([9.81, 0.0, 0.0], (len(t_ns), 1)))


def turns(offset_ns: int = 0, R_SB: np.ndarray | None = None, sigma: float = 0.0, n: int = 40) -> Turns:
    """Exact turns of a sensor with axes R_SB, whose clock shows ``offset_ns`` less than the gyroscope's."""
    exact = GyroRotation(samples(bias=np.zeros(3)))
    first = START_NS + 300_000_000 + 220_000_000 * np.arange(n)
    phi_B = exact.turned(first, first + 200_000_000)
    noise = sigma * np.random.default_rng(1).standard_normal((n, 3))
    R = np.eye(3) if R_SB is None else R_SB
    return Turns(first - offset_ns, first + 200_000_000 - offset_ns, phi_B @ R.T + noise, R.T)


@pytest.mark.parametrize("offset_ms", [0.0, 1.7, -23.0, 61.3])
def test_offset_and_bias_are_found(offset_ms: float) -> None:
    """The sign of the offset, a step lost in the search, or a bias that bends it."""
    fit = compare_turns(GyroRotation(samples()), turns(round(offset_ms * 1e6), sigma=5e-4))
    assert fit is not None
    assert fit.offset_s == pytest.approx(1e-3 * offset_ms, abs=max(4.0 * fit.offset_sigma_s, 2e-4))
    assert fit.offset_sigma_s < 1e-3
    np.testing.assert_allclose(fit.gyro_bias, BIAS, atol=2e-3)


@pytest.mark.parametrize(
    ("R_BS", "value"), [(np.eye(3), "offset_s"), (so3.exp(np.radians([1.0, -2.0, 0.5])), "axes_deg")]
)
def test_deviations_are_those_of_repeated_draws(R_BS: np.ndarray, value: str) -> None:
    """A deviation that is believed but several times too small or too large."""
    clean = turns()
    errors, sigmas = [], []
    for seed in range(60):
        noise = 1e-3 * np.random.default_rng(seed).standard_normal(clean.phi_S.shape)
        noisy = Turns(clean.first_ns, clean.second_ns, clean.phi_S + noise, R_BS)
        fit = compare_turns(GyroRotation(samples()), noisy)
        assert fit is not None
        errors.append(getattr(fit, value))
        sigmas.append(getattr(fit, value.replace("_", "_sigma_")))
    assert 0.7 < np.std(errors) / np.mean(sigmas) < 1.4


@pytest.mark.parametrize("angle_deg", [0.0, 1.0, 90.0, 179.0])
def test_axes_are_found_beside_an_offset(angle_deg: float) -> None:
    """An axis error taken for an offset, or seen only where clocks agree."""
    axis = np.array([0.6, -0.48, 0.64])
    wrong = so3.exp(np.radians(angle_deg) * axis)
    seen = turns(15_000_000)
    fit = compare_turns(GyroRotation(samples()), Turns(seen.first_ns, seen.second_ns, seen.phi_S, wrong))
    assert fit is not None
    assert fit.axes_deg == pytest.approx(angle_deg, abs=0.4)


@pytest.mark.parametrize("scale", [1.0, 0.5, 57.29578])
def test_scale_is_found(scale: float) -> None:
    fit = compare_turns(GyroRotation(samples(scale, np.zeros(3))), turns())
    assert fit is not None
    # Turns of tens of radians wrap; that they are far from 1 is all that is asked then.
    assert fit.scale == pytest.approx(scale, rel=0.02) if scale < 10.0 else not 0.5 < fit.scale < 1.5


def test_wrong_turns_are_left_out() -> None:
    """One wrong pose of ten that spoils the fit."""
    seen = turns(8_000_000, sigma=3e-4)
    seen.phi_S[::10] += [0.3, -0.2, 0.4]
    fit = compare_turns(GyroRotation(samples()), seen)
    assert fit is not None and fit.n_turns == 36
    assert fit.offset_s == pytest.approx(0.008, abs=4.0 * fit.offset_sigma_s)


def test_too_little_to_tell_gives_no_fit() -> None:
    """Numbers made of noise."""
    gyro = GyroRotation(samples())
    assert compare_turns(gyro, turns(n=5)) is None
    still = turns()
    assert compare_turns(gyro, Turns(still.first_ns, still.second_ns, 1e-3 * still.phi_S, np.eye(3))) is None


def test_one_axis_only_leaves_axes_unknown() -> None:
    """Axes claimed from turns that do not determine them."""
    t_ns = START_NS + 5_000_000 * np.arange(2001)
    about_z = np.zeros((2001, 3))
    about_z[:, 2] = np.sin(2.0 * (t_ns - START_NS) * 1e-9)
    gyro = GyroRotation(ImuSamples(t_ns, about_z, about_z))
    first = START_NS + 300_000_000 + 220_000_000 * np.arange(40)
    seen = Turns(first, first + 200_000_000, gyro.turned(first, first + 200_000_000), np.eye(3))
    fit = compare_turns(gyro, seen)
    assert fit is not None and np.isnan(fit.axes_deg)


@pytest.mark.parametrize(("sigma_deg", "warned"), [(0.1, True), (0.3, False)])
def test_axes_within_their_deviation_are_not_called_off(sigma_deg: float, warned: bool) -> None:
    """A warning about noise: 0.9 deg are no more than 0.5 where they are known to 0.3."""
    gyro, seen, out = GyroRotation(samples()), turns(), Findings("x")
    fit = compare_turns(gyro, seen)
    assert fit is not None
    fit = replace(fit, axes_deg=0.9, axes_sigma_deg=sigma_deg)
    _judge_turns("truth", fit, gyro, seen.first_ns, gyro.at(seen.first_ns), out)
    assert any("axes 0.90 deg" in found.message for found in out.of("warning")) == warned
