"""Visual-inertial alignment without truth, on simulated motions whose biases are known."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from vigauge.errors import DataError, DegenerateError, VigaugeError
from vigauge.geometry import so3
from vigauge.model.imu import ImuNoise, ImuSamples
from vigauge.recordings.alignment import Alignment, align
from vigauge.synthetic.measurements import corrupt_imu, ideal_imu
from vigauge.synthetic.spline import SplineTrajectory

G = 9.81
NOISE = ImuNoise(2e-4, 3e-3)
STEP = (0.004, 0.002)
SEEDS = range(20)


@dataclass(frozen=True)
class Flight:
    """Visual poses with a random walk's errors, samples with biases, and what is true of them."""

    p_M: np.ndarray
    R_MB: np.ndarray
    imu: ImuSamples
    t_ns: np.ndarray
    p_B: np.ndarray
    scale: float
    gyro_bias: np.ndarray
    accel_bias: np.ndarray
    R_WM: np.ndarray
    v_W: np.ndarray


def flight(
    seed: int,
    *,
    turn: float = 0.3,
    reach: float = 0.4,
    still_s: float = 0.0,
    speed: float = 0.0,
    mono: bool = False,
    accel: float = 0.2,
    step: tuple[float, float] = STEP,
    noise: ImuNoise = NOISE,
) -> Flight:
    """Four seconds, twelve keyframes; it stands until ``still_s``; ``mono``: the camera's poses, unscaled."""
    rng = np.random.default_rng(seed)
    knots = np.linspace(-0.5, 4.5, 20)
    moves = (knots > still_s)[:, None]
    p = moves * rng.normal(0.0, reach, (20, 3)) + knots[:, None] * [speed, 0.0, 0.0]
    R_ref = so3.exp(rng.uniform(-1.5, 1.5, 3))
    spline = SplineTrajectory.through(knots, p, moves * rng.normal(0.0, turn, (20, 3)), R_ref)
    t_ns = 5_000_000 * np.arange(801, dtype=np.int64)
    gyro_bias, accel_bias = rng.normal(0.0, 0.05, 3), rng.normal(0.0, accel, 3)
    imu = corrupt_imu(ideal_imu(spline, t_ns, G), noise, gyro_bias, accel_bias, rng)
    keyframes = t_ns[np.linspace(0, 800, 12).astype(int)]
    t = keyframes * 1e-9
    R_WB, p_B, scale = spline.R_WB(t), np.zeros(3), 1.0
    if mono:
        p_B, scale = np.array([0.1, -0.05, 0.2]), 0.37
    c_W = spline.p_W(t) + R_WB @ p_B
    p_M, R_MB = [np.zeros(3)], [np.eye(3)]
    for i in range(len(t) - 1):
        ahead = R_WB[i].T @ (c_W[i + 1] - c_W[i]) / scale + rng.normal(0.0, step[0] / scale, 3)
        p_M.append(p_M[-1] + R_MB[-1] @ ahead)
        R_MB.append(R_MB[-1] @ R_WB[i].T @ R_WB[i + 1] @ so3.exp(rng.normal(0.0, step[1], 3)))
    return Flight(
        np.array(p_M),
        np.array(R_MB),
        imu,
        keyframes,
        p_B,
        scale,
        gyro_bias,
        accel_bias,
        R_WB[0],
        spline.v_W(t),
    )


def aligned(f: Flight, **options: Any) -> Alignment:
    options = {"noise": NOISE, "gravity": G, "p_B": f.p_B, "scale": f.scale != 1.0} | options
    return align(f.p_M, f.R_MB, f.imu, f.t_ns, **options)


def errors_in_sigmas(f: Flight, a: Alignment) -> tuple[np.ndarray, float]:
    """Errors of biases, turn of gravity and velocities by their sigmas; NEES of biases and gravity (8)."""
    down = np.array([0.0, 0.0, -1.0])
    tilt = np.cross(f.R_WM.T @ down, a.R_WM.T @ down)
    error = np.concatenate([a.gyro_bias - f.gyro_bias, a.accel_bias - f.accel_bias, tilt])
    size = np.sqrt(np.diagonal(a.covariance))
    whitened = error / size
    nees = float(
        whitened @ np.linalg.pinv(a.covariance / np.outer(size, size), rcond=1e-8, hermitian=True) @ whitened
    )
    velocity = (a.v_M - f.v_W @ f.R_WM) / a.velocity_sigma
    scale = [(a.scale - f.scale) / (a.scale * a.scale_sigma)] if a.scale_sigma else []
    return np.concatenate([whitened, velocity.ravel(), scale]), nees


@pytest.mark.parametrize(
    "kind",
    [
        {},
        {"mono": True},
        {"still_s": 2.0},
        {"turn": 0.0, "accel": 0.03},
        {"reach": 0.0},
        {"reach": 0.0, "turn": 0.0, "accel": 0.03},
        {"reach": 0.0, "turn": 0.0, "accel": 0.03, "speed": 1.0},
    ],
    ids=["moving", "mono", "standing start", "no turn", "on the spot", "standing", "even"],
)
def test_biases_gravity_velocities_and_scale_lie_within_their_sigmas(kind: dict[str, Any]) -> None:
    """A sign or frame of a derivative, noise counted twice, a lever arm left out, sigmas that say nothing."""
    nees = []
    for seed in SEEDS:
        f = flight(seed, **kind)
        errors, own = errors_in_sigmas(
            f, aligned(f, step_sigma=(STEP[0] / f.scale, STEP[1]), accel_bias_sigma=kind.get("accel", 0.2))
        )
        assert np.abs(errors).max() < 4.5
        nees.append(own)
    low, high = chi2.ppf([0.0005, 0.9995], 8 * len(SEEDS)) / len(SEEDS)
    assert low < np.mean(nees) < high


def test_sigmas_of_the_visual_steps_are_told_by_the_residuals() -> None:
    """A guess that stays what it was: sigmas of all else are off by as much."""
    found = np.array([aligned(flight(seed)).step_sigma for seed in SEEDS])
    np.testing.assert_allclose(np.median(found, axis=0), STEP, rtol=0.15)


def test_exact_poses_give_the_biases_to_the_samples_noise() -> None:
    """What the integration or the linearisation leaves behind, far below the noise of real poses."""
    f = flight(1, step=(0.0, 0.0), noise=ImuNoise(0.0, 0.0))
    a = aligned(f, step_sigma=(1e-5, 1e-6))
    np.testing.assert_allclose(a.gyro_bias, f.gyro_bias, atol=1e-4)
    np.testing.assert_allclose(a.accel_bias, f.accel_bias, atol=5e-3)
    np.testing.assert_allclose(a.v_M, f.v_W @ f.R_WM, atol=2e-3)
    np.testing.assert_allclose(a.p_M, f.p_M, atol=1e-3)
    # What is left of the turn between the true first attitude and ours is about z alone.
    assert np.abs((a.R_WM @ f.R_WM.T)[2] - [0, 0, 1]).max() < 1e-3


def test_bias_that_cannot_be_told_from_gravity_stays_at_its_prior_and_that_is_said() -> None:
    """A bias that is the noise's, with a sigma that looks like knowledge."""
    still = aligned(flight(2, turn=0.0))
    assert len(still.remarks) == 2 and "stays at its prior" in still.remarks[0]
    across = np.linalg.eigvalsh(still.covariance[3:6, 3:6])[1:]
    np.testing.assert_allclose(np.sqrt(across), 0.2, rtol=0.05)
    assert still.tilt_sigma == pytest.approx(0.2 / G, rel=0.1)
    turning = aligned(flight(2))
    assert turning.remarks == () and turning.accel_bias_sigma.max() < 0.06


def test_standing_gives_the_gyroscope_bias_and_gravity() -> None:
    """Velocities of zero, steps of zero: nothing may divide by them."""
    f = flight(3, turn=0.0, reach=0.0)
    a = aligned(f)
    assert np.abs(errors_in_sigmas(f, a)[0]).max() < 4.5
    assert np.abs(a.v_M).max() < 0.05


@pytest.mark.parametrize(
    "kind", [{"reach": 0.0, "turn": 0.0}, {"reach": 0.0, "speed": 1.0, "turn": 0.0}], ids=["standing", "even"]
)
def test_scale_that_the_motion_does_not_tell_is_refused(kind: dict[str, Any]) -> None:
    """A metric map whose metre is the noise's."""
    for seed in range(3):
        with pytest.raises(DegenerateError, match=r"scale of the map.*would do"):
            aligned(flight(seed, mono=True, **kind))


@pytest.mark.parametrize("fault", ["unit", "frame"])
def test_poses_that_do_not_belong_to_the_samples_are_refused(fault: str) -> None:
    """Positions in another unit, or extrinsics left out: a wild start instead of an error."""
    f = flight(4)
    R_MB = f.R_MB @ so3.exp(np.array([0.0, np.pi, 0.0])) @ f.R_MB if fault == "frame" else f.R_MB
    with pytest.raises(VigaugeError, match="gravity"):
        aligned(replace(f, p_M=100.0 * f.p_M, R_MB=R_MB))


@pytest.mark.parametrize(
    ("change", "options", "rule"),
    [
        (slice(0, 2), {}, "at least three keyframes"),
        (slice(None, None, -1), {}, "must increase"),
        (slice(0, 5), {"step_sigma": (0.0, 0.01)}, "must be positive"),
        (slice(0, 5), {"accel_bias_sigma": 0.0}, "accel_bias_sigma"),
        (slice(0, 5), {"p_B": (0.0, np.nan, 0.0)}, "p_B"),
    ],
)
def test_input_that_cannot_be_used_is_named(change: slice, options: dict[str, Any], rule: str) -> None:
    """A numpy error from the depth of the least squares instead of what is wrong with the input."""
    f = flight(5)
    with pytest.raises(DataError, match=rule):
        aligned(replace(f, p_M=f.p_M[change], R_MB=f.R_MB[change], t_ns=f.t_ns[change]), **options)
