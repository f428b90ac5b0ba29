"""What the simulated sensors report: noise of the stated size, biases, and points in the image."""

import numpy as np
from scipy.stats import chi2

from support.simulated import SETTINGS, scene, trial
from vigauge.geometry.camera import Camera
from vigauge.model.imu import ImuNoise, ImuSamples
from vigauge.synthetic.measurements import MINIMUM_DEPTH, corrupt_imu, ideal_imu, visible_points

NOISE = ImuNoise(SETTINGS.gyro_density, SETTINGS.accel_density)


def test_ideal_samples_are_those_of_the_trajectory():
    """Catches stamps in another unit, or samples at other times."""
    motion = scene("sine").trajectory
    t_ns = np.array([0, 123_456_789, 2_000_000_000])
    samples = ideal_imu(motion, t_ns, 9.81)
    assert np.allclose(samples.gyro, motion.omega_B(t_ns / 1e9), rtol=0, atol=1e-14)
    assert np.allclose(samples.accel, motion.specific_force_B(t_ns / 1e9, 9.81), rtol=0, atol=1e-13)
    assert np.array_equal(samples.t_ns, t_ns)


def test_noise_and_biases_have_the_stated_size():
    """Catches a density taken for a deviation, biases swapped, or correlated axes."""
    t_ns = 5_000_000 * np.arange(20_000)
    still = ImuSamples(t_ns, np.zeros((len(t_ns), 3)), np.zeros((len(t_ns), 3)))
    gyro_bias, accel_bias = np.array([0.1, -0.2, 0.3]), np.array([1.0, 2.0, -3.0])
    noisy = corrupt_imu(still, NOISE, gyro_bias, accel_bias, np.random.default_rng(0))
    low, high = chi2.interval(0.9999, len(t_ns))
    for values, bias, density in (
        (noisy.gyro, gyro_bias, NOISE.gyro_density),
        (noisy.accel, accel_bias, NOISE.accel_density),
    ):
        sigma = density * np.sqrt(200.0)
        assert np.allclose(values.mean(axis=0), bias, rtol=0, atol=5.0 * sigma / np.sqrt(len(t_ns)))
        sums = np.sum(((values - bias) / sigma) ** 2, axis=0)
        assert np.all((low < sums) & (sums < high))
    both = np.hstack([noisy.gyro, noisy.accel])
    assert np.abs(np.corrcoef(both.T) - np.eye(6)).max() < 5.0 / np.sqrt(len(t_ns))


def test_pixel_noise_has_the_stated_size():
    """Catches noise that is not sigma_px in both directions."""
    world = scene("arc", "random", n_landmarks=200, minimum_views=2)
    problem = trial(0, "arc", "random", n_landmarks=200, minimum_views=2)
    order = np.lexsort((world.keyframe, world.landmark))
    noise = problem.obs_uv - world.uv[order]
    low, high = chi2.interval(0.9999, len(noise))
    sums = np.sum((noise / SETTINGS.sigma_px) ** 2, axis=0)
    assert np.all((low < sums) & (sums < high))
    assert np.array_equal(problem.obs_keyframe, world.keyframe[order])


def test_visible_points_are_in_front_and_inside():
    """Catches points behind the camera, outside the image, or projected with the wrong pose."""
    camera = Camera(100.0, 110.0, 80.0, 60.0, 160, 120, (0.0, 0.0, 0.0, 0.0), np.eye(3), np.zeros(3))
    p_W = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    R_WB = np.stack([np.eye(3), np.eye(3)])
    X_W = np.array(
        [
            [0.0, 0.0, 5.0],  # both
            [0.0, 0.0, -5.0],  # behind
            [0.0, 0.0, 1.0 + 0.5 * MINIMUM_DEPTH],  # too near for the second
            [3.0, 0.0, 4.0],  # inside the first only
            [0.0, 9.0, 5.0],  # outside
            [-4.0, 0.0, 5.0],  # on the left border of the first
        ]
    )
    keyframe, landmark, uv = visible_points(p_W, R_WB, camera, X_W)
    assert list(zip(keyframe.tolist(), landmark.tolist(), strict=True)) == [
        (0, 0),
        (0, 2),
        (0, 3),
        (0, 5),
        (1, 0),
    ]
    assert np.allclose(uv, [[80, 60], [80, 60], [155, 60], [0, 60], [80, 60]])


def test_extrinsics_enter_the_images():
    """Catches a camera placed at the body's origin: a rig's own pose moves its view."""
    R_BC = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    camera = Camera(100.0, 100.0, 80.0, 60.0, 160, 120, (0.0, 0.0, 0.0, 0.0), R_BC, np.array([0.5, 0.2, 0.1]))
    _, landmark, uv = visible_points(np.zeros((1, 3)), np.eye(3)[None], camera, np.array([[4.5, 0.2, 0.1]]))
    assert landmark.tolist() == [0]
    assert np.allclose(uv, [[80.0, 60.0]])
