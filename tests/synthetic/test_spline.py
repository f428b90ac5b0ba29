"""The spline trajectory: its sensors against finite differences of its poses."""

import numpy as np
import pytest

from support.derivatives import central_differences
from support.simulated import scene
from vigauge.geometry import so3
from vigauge.synthetic.spline import SplineTrajectory

TIMES = np.linspace(0.05, 2.45, 9)


@pytest.mark.parametrize("shape", ["sine", "arc", "rec"])
@pytest.mark.parametrize("t", TIMES)
def test_sensors_are_the_derivatives_of_the_poses(shape, t):
    """Catches an IMU that belongs to another motion: velocity, acceleration, angular velocity and
    specific force against differences of positions and rotations."""
    motion = scene(shape).trajectory
    v_W = central_differences(lambda h: motion.p_W(t + h[0]), 1)[:, 0]
    a_W = central_differences(lambda h: motion.v_W(t + h[0]), 1)[:, 0]
    R_WB = motion.R_WB(t)
    omega_B = central_differences(lambda h: so3.log(R_WB.T @ motion.R_WB(t + h[0])), 1)[:, 0]
    assert np.allclose(motion.v_W(t), v_W, rtol=0, atol=1e-6)
    assert np.allclose(motion.a_W(t), a_W, rtol=0, atol=1e-4)
    assert np.allclose(motion.omega_B(t), omega_B, rtol=0, atol=1e-6)
    force_B = R_WB.T @ (a_W + [0.0, 0.0, 9.81])
    assert np.allclose(motion.specific_force_B(t, 9.81), force_B, rtol=0, atol=1e-4)


def test_spline_goes_through_its_points():
    """Catches a smoothing fit where an interpolating one is meant, and R_ref on the wrong side."""
    rng = np.random.default_rng(0)
    t = np.linspace(0.0, 2.0, 12)
    p_W, phi, R_ref = rng.normal(size=(12, 3)), rng.normal(0, 0.3, (12, 3)), so3.exp([0.3, 0.2, -0.1])
    motion = SplineTrajectory.through(t, p_W, phi, R_ref)
    assert np.allclose(motion.p_W(t), p_W, rtol=0, atol=1e-12)
    assert np.allclose(motion.R_WB(t), R_ref @ so3.exp(phi), rtol=0, atol=1e-12)


def test_standing_still_an_accelerometer_reads_gravity_upwards():
    """Catches the sign of gravity: a level, resting body reads +g along its z axis."""
    t = np.linspace(0.0, 1.0, 8)
    motion = SplineTrajectory.through(t, np.zeros((8, 3)), np.zeros((8, 3)), np.eye(3))
    assert np.allclose(motion.specific_force_B(0.5, 9.81), [0.0, 0.0, 9.81])
    assert np.allclose(motion.omega_B(0.5), 0.0)


def test_times_of_any_shape():
    """Catches a method that only takes vectors: one time gives one pose."""
    motion = scene("sine").trajectory
    assert motion.p_W(0.3).shape == (3,)
    assert motion.R_WB(0.3).shape == (3, 3)
    assert motion.omega_B(np.zeros((2, 5))).shape == (2, 5, 3)
    assert np.array_equal(motion.specific_force_B(TIMES, 9.81)[3], motion.specific_force_B(TIMES[3], 9.81))
