"""Preintegration: against the exact motion, against Monte-Carlo noise, and where samples are missing."""

import numpy as np
import pytest
from scipy.stats import chi2

from support.derivatives import central_differences, row_error
from support.simulated import SETTINGS, scene
from vigauge.errors import DataError
from vigauge.geometry import so3
from vigauge.model.imu import ImuNoise, ImuSamples, preintegrate
from vigauge.synthetic.measurements import ideal_imu

NOISE = ImuNoise(SETTINGS.gyro_density, SETTINGS.accel_density)
G = SETTINGS.gravity_mps2
SAMPLE_NS = 5_000_000
# Starts and ends on samples, and starts and ends between them.
INTERVALS = [
    (250_000_000, 550_000_000),
    (251_300_001, 548_700_003),
    (1_003_000_000, 1_013_000_000),
    (600_000_000, 603_000_000),
]


def exact_increments(trajectory, start_ns: int, end_ns: int):
    """dp, dR, dv of the spline itself, in the body frame at the start."""
    a, b = start_ns * 1e-9, end_ns * 1e-9
    dt, g_W = b - a, np.array([0.0, 0.0, -G])
    R_T = trajectory.R_WB(a).T
    shift_W = trajectory.p_W(b) - trajectory.p_W(a) - trajectory.v_W(a) * dt - 0.5 * g_W * dt**2
    return (R_T @ shift_W, R_T @ trajectory.R_WB(b), R_T @ (trajectory.v_W(b) - trajectory.v_W(a) - g_W * dt))


def difference(measured, dp, dR, dv) -> np.ndarray:
    """(9,) error of the increments, in the order of their covariance."""
    return np.concatenate([measured.dp - dp, so3.log(dR.T @ measured.dR), measured.dv - dv])


def whitened(measured, error: np.ndarray) -> np.ndarray:
    return np.linalg.solve(np.linalg.cholesky(measured.covariance), error)


@pytest.mark.parametrize("shape", ["sine", "arc", "rec"])
@pytest.mark.parametrize(("start_ns", "end_ns"), INTERVALS)
def test_increments_follow_the_exact_motion(shape, start_ns, end_ns):
    """Catches Euler steps (several sigma off), a frame or gravity error, and samples shifted by one:
    noise-free samples at 200 Hz must give the spline's own increments within a fifth of a sigma."""
    motion = scene(shape)
    measured = preintegrate(motion.imu, start_ns, end_ns, NOISE)
    assert measured.dt == pytest.approx((end_ns - start_ns) * 1e-9, abs=1e-15)
    error = difference(measured, *exact_increments(motion.trajectory, start_ns, end_ns))
    assert np.abs(whitened(measured, error)).max() < 0.2


def test_integration_is_of_second_order_at_least():
    """Catches a first-order scheme: halving the sample period must quarter the error."""
    motion = scene("sine")
    errors = []
    for step_ns in (8_000_000, 4_000_000):
        stamps = np.arange(0, 1_200_000_001, step_ns)
        measured = preintegrate(ideal_imu(motion.trajectory, stamps, G), 0, 800_000_000, NOISE)
        errors.append(np.abs(difference(measured, *exact_increments(motion.trajectory, 0, 800_000_000))))
    assert np.all(errors[1] < errors[0] / 3.5)


@pytest.mark.parametrize(("start_ns", "end_ns"), INTERVALS)
def test_covariance_is_that_of_the_noise(start_ns, end_ns):
    """Catches a wrong density convention, a missing cross term, or a sample counted twice: the
    whitened errors of many noisy runs have unit covariance, entry by entry."""
    trials = 1500
    motion = scene("sine")
    ideal = motion.imu
    inside = (ideal.t_ns >= start_ns - 2 * SAMPLE_NS) & (ideal.t_ns <= end_ns + 2 * SAMPLE_NS)
    ideal = ImuSamples(ideal.t_ns[inside], ideal.gyro[inside], ideal.accel[inside])
    clean = preintegrate(ideal, start_ns, end_ns, NOISE)
    rng = np.random.default_rng(5)
    scale = 1.0 / np.sqrt(SAMPLE_NS * 1e-9)
    errors = []
    for _ in range(trials):
        noisy = ImuSamples(
            ideal.t_ns,
            ideal.gyro + rng.normal(0.0, NOISE.gyro_density * scale, ideal.gyro.shape),
            ideal.accel + rng.normal(0.0, NOISE.accel_density * scale, ideal.accel.shape),
        )
        run = preintegrate(noisy, start_ns, end_ns, NOISE)
        errors.append(whitened(clean, difference(run, clean.dp, clean.dR, clean.dv)))
    errors = np.array(errors)
    low, high = chi2.interval(0.9999, trials)
    sums = np.sum(errors**2, axis=0)
    assert np.all((low < sums) & (sums < high)), sums / trials
    correlation = errors.T @ errors / trials - np.diag(sums / trials)
    assert np.abs(correlation).max() < 4.5 / np.sqrt(trials)


def test_turning_axes_are_integrated_to_fourth_order():
    """Catches the wrong sign of the commutator, which takes a turning axis of rotation into account:
    coarse samples of a rate that changes linearly, against very fine ones."""

    def turn(step_ns: int) -> np.ndarray:
        t_ns = np.arange(0, 1_600_000_001, step_ns)
        t = t_ns[:, None] * 1e-9
        gyro = np.array([2.0, 0.0, 0.5]) + t * np.array([-1.0, 2.0, 0.3])
        return preintegrate(ImuSamples(t_ns, gyro, 0.0 * gyro), 0, 1_600_000_000, NOISE).dR

    exact = turn(1_000_000)
    coarse, half = (np.linalg.norm(so3.log(exact.T @ turn(step))) for step in (100_000_000, 50_000_000))
    assert coarse < 1e-5
    assert half < coarse / 12.0


def test_covariance_is_propagated_to_first_order():
    """Catches an approximate weight, which shows where keyframes are only few samples apart: the
    covariance is that of the numerical derivative of the increments by every single sample."""
    start_ns, end_ns = 1_003_000_000, 1_042_000_000
    samples = scene("rec").imu
    inside = (samples.t_ns >= start_ns - SAMPLE_NS) & (samples.t_ns <= end_ns + SAMPLE_NS)
    samples = ImuSamples(samples.t_ns[inside], samples.gyro[inside], samples.accel[inside])
    clean = preintegrate(samples, start_ns, end_ns, NOISE)

    def increments(change):
        gyro, accel = change.reshape(2, -1, 3)
        run = ImuSamples(samples.t_ns, samples.gyro + gyro, samples.accel + accel)
        return difference(preintegrate(run, start_ns, end_ns, NOISE), clean.dp, clean.dR, clean.dv)

    J = central_differences(increments, 6 * len(samples.t_ns))
    density = np.repeat([NOISE.gyro_density, NOISE.accel_density], 3 * len(samples.t_ns))
    J = J * density / np.sqrt(SAMPLE_NS * 1e-9)
    W = np.linalg.inv(np.linalg.cholesky(clean.covariance))
    assert np.abs(W @ J @ J.T @ W.T - np.eye(9)).max() < 1e-5


def test_covariance_grows_with_the_densities():
    """Catches noise that is added where it should be multiplied."""
    samples = scene("arc").imu
    a = preintegrate(samples, 0, 300_000_000, NOISE).covariance
    b = preintegrate(samples, 0, 300_000_000, NOISE.scaled(3.0)).covariance
    assert np.allclose(b, 9.0 * a, rtol=1e-12)


def test_covariance_does_not_depend_on_the_sampling_rate():
    """Catches a density taken for a per-sample deviation: twice the rate, the same covariance."""
    motion = scene("sine")
    covariances = []
    for step_ns in (5_000_000, 2_500_000):
        samples = ideal_imu(motion.trajectory, np.arange(0, 700_000_001, step_ns), G)
        covariances.append(preintegrate(samples, 100_000_000, 600_000_000, NOISE).covariance)
    assert np.linalg.norm(covariances[1] - covariances[0]) < 0.01 * np.linalg.norm(covariances[0])


@pytest.mark.parametrize(("start_ns", "end_ns"), INTERVALS)
def test_increments_follow_the_biases(start_ns, end_ns):
    """Catches the derivative of another scheme than ours (the commutator of a step, the half step at both
    ends), a sign, or a rotation on the left: against differences of increments of corrected samples."""
    motion = scene("rec")
    at = np.array([0.02, -0.03, 0.01]), np.array([0.2, 0.1, -0.3])
    clean = preintegrate(motion.imu.corrected(*at), start_ns, end_ns, NOISE)

    def increments(change):
        run = motion.imu.corrected(at[0] + change[:3], at[1] + change[3:])
        return difference(preintegrate(run, start_ns, end_ns, NOISE), clean.dp, clean.dR, clean.dv)

    J = central_differences(increments, 6)
    assert row_error(clean.by_gyro_bias, J[:, :3]) < 1e-9
    scale = np.abs(J[:, 3:]).max()
    assert np.abs(clean.by_accel_bias - J[:, 3:]).max() < 1e-9 * scale
    assert not clean.walk_covariance.any()


def test_walk_adds_its_share():
    """Catches a walk that starts a step late or acts on the interval before: its covariance against that of
    drawn walks, and its last rows those of Brownian motion."""
    start_ns, end_ns, trials = 251_300_001, 548_700_003, 1500
    noise = ImuNoise(1e-4, 1e-3, gyro_walk=0.02, accel_walk=0.3)
    ideal = scene("sine").imu
    inside = (ideal.t_ns >= start_ns - SAMPLE_NS) & (ideal.t_ns <= end_ns + SAMPLE_NS)
    ideal = ImuSamples(ideal.t_ns[inside], ideal.gyro[inside], ideal.accel[inside])
    clean = preintegrate(ideal, start_ns, end_ns, noise)
    dt = clean.dt
    steps = clean.walk_covariance[9:, 9:]
    assert np.allclose(steps, np.diag(dt * np.repeat([0.02**2, 0.3**2], 3)), rtol=1e-12)
    # A walk from the start to every sample and to the end; before the start it runs backwards.
    t = np.concatenate([ideal.t_ns - start_ns, [end_ns - start_ns]]) * 1e-9
    before, order = t < 0.0, np.argsort(t)
    rng = np.random.default_rng(2)
    errors = []
    for _ in range(trials):
        b = np.zeros((len(t), 6))
        for some in (order[~before[order]], order[before[order]][::-1]):
            widths = np.sqrt(np.diff(np.abs(t[some]), prepend=0.0))[:, None]
            b[some] = np.cumsum(widths * rng.normal(size=(len(some), 6)), axis=0)
        b *= np.repeat([0.02, 0.3], 3)
        run = ImuSamples(ideal.t_ns, ideal.gyro + b[:-1, :3], ideal.accel + b[:-1, 3:])
        error = difference(preintegrate(run, start_ns, end_ns, noise), clean.dp, clean.dR, clean.dv)
        errors.append(np.concatenate([-error, b[-1]]))
    found = np.array(errors).T @ np.array(errors) / trials
    W = np.linalg.inv(np.linalg.cholesky(clean.walk_covariance))
    assert np.abs(W @ found @ W.T - np.eye(15)).max() < 5.5 / np.sqrt(trials)


def test_intervals_compose():
    """Catches an interval that starts one sample early or late: two halves make the whole."""
    samples = scene("rec").imu
    whole = preintegrate(samples, 0, 400_000_000, NOISE)
    first, second = (
        preintegrate(samples, 0, 150_000_000, NOISE),
        preintegrate(samples, 150_000_000, 400_000_000, NOISE),
    )
    assert np.allclose(first.dR @ second.dR, whole.dR, rtol=0, atol=1e-13)
    assert np.allclose(first.dv + first.dR @ second.dv, whole.dv, rtol=0, atol=1e-12)
    dp = first.dp + first.dv * second.dt + first.dR @ second.dp
    assert np.allclose(dp, whole.dp, rtol=0, atol=1e-12)


def test_stamps_of_real_size_keep_their_nanoseconds():
    """Catches stamps taken through float64: at 1.4e18 ns they would snap to 256 ns."""
    samples = scene("sine").imu
    offset = 1_403_636_580_863_555_585
    late = ImuSamples(samples.t_ns + offset, samples.gyro, samples.accel)
    a = preintegrate(samples, 1_000_001, 300_000_003, NOISE)
    b = preintegrate(late, offset + 1_000_001, offset + 300_000_003, NOISE)
    assert a.dt == b.dt
    assert np.array_equal(a.dp, b.dp)
    assert np.array_equal(a.covariance, b.covariance)


def test_constant_rate_and_force_are_exact():
    """Catches a wrong factor in closed form: constant body rate and constant world force."""
    t_ns = np.arange(0, 1_000_000_001, SAMPLE_NS)
    still = ImuSamples(t_ns, np.zeros((len(t_ns), 3)), np.tile([1.0, -2.0, 9.81], (len(t_ns), 1)))
    out = preintegrate(still, 0, 1_000_000_000, ImuNoise(0.0, NOISE.accel_density))
    assert np.allclose(out.dv, [1.0, -2.0, 9.81], rtol=1e-13)
    assert np.allclose(out.dp, [0.5, -1.0, 4.905], rtol=1e-13)
    # Standing still the covariance has the textbook form sigma^2 t, sigma^2 t^3 / 3, sigma^2 t^2 / 2.
    block = out.covariance[np.ix_([0, 6], [0, 6])] / NOISE.accel_density**2
    assert np.allclose(block, [[1.0 / 3.0, 0.5], [0.5, 1.0]], rtol=0.01)
    turning = preintegrate(still, 0, 1_000_000_000, NOISE).covariance[3:6, 3:6]
    assert np.allclose(turning, NOISE.gyro_density**2 * np.eye(3), rtol=0.01, atol=1e-20)
    spin = ImuSamples(t_ns, np.tile([0.3, -0.2, 2.0], (len(t_ns), 1)), np.zeros((len(t_ns), 3)))
    assert np.allclose(
        preintegrate(spin, 0, 1_000_000_000, NOISE).dR, so3.exp([0.3, -0.2, 2.0]), rtol=0, atol=1e-13
    )


def test_biases_are_taken_off():
    """Catches a bias added instead of removed, or gyro and accelerometer exchanged."""
    samples = scene("sine").imu
    biased = ImuSamples(samples.t_ns, samples.gyro + [0.1, 0.2, 0.3], samples.accel + [-1.0, 0.5, 2.0])
    corrected = biased.corrected(np.array([0.1, 0.2, 0.3]), np.array([-1.0, 0.5, 2.0]))
    assert np.allclose(corrected.gyro, samples.gyro, rtol=0, atol=1e-15)
    assert np.allclose(corrected.accel, samples.accel, rtol=0, atol=1e-14)
    assert corrected.period() == pytest.approx(0.005)


@pytest.mark.parametrize(
    ("start_ns", "end_ns", "rule"),
    [
        (-1, 100_000_000, "cover"),
        (0, 10**12, "cover"),
        (100_000_000, 100_000_000, "positive length"),
        (200_000_000, 100_000_000, "positive length"),
    ],
)
def test_intervals_without_samples_are_refused(start_ns, end_ns, rule):
    """Catches silent extrapolation beyond the samples."""
    with pytest.raises(DataError, match=rule):
        preintegrate(scene("sine").imu, start_ns, end_ns, NOISE)


def test_too_few_samples_are_refused():
    """Catches an index error where a recording has no samples at all."""
    empty = ImuSamples(np.array([], dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 3)))
    with pytest.raises(DataError, match="cover"):
        preintegrate(empty, 0, 100, NOISE)
