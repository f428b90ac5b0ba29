"""Visual-inertial alignment on motions whose velocities and gravity are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vigauge.errors import VigaugeError
from vigauge.geometry import so3
from vigauge.model.imu import ImuNoise, ImuSamples, preintegrate
from vigauge.model.problem import InertialFactors
from vigauge.recordings.frontend.initialisation import align_with_gravity, turn_onto
from vigauge.synthetic.spline import SplineTrajectory

G = 9.81


def motion(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray, InertialFactors]:
    """p_W, R_WB, v_W at twelve keyframes of a lively flight, and its noise-free factors."""
    rng = np.random.default_rng(seed)
    knots = np.linspace(-0.5, 4.5, 16)
    R_ref = so3.exp(rng.uniform(-1.5, 1.5, 3))
    spline = SplineTrajectory.through(knots, rng.normal(0, 0.4, (16, 3)), rng.normal(0, 0.2, (16, 3)), R_ref)
    t = np.arange(0, 4.0005, 0.005)
    t_ns = np.rint(t * 1e9).astype(np.int64)
    imu = ImuSamples(t_ns, spline.omega_B(t), spline.specific_force_B(t, G))
    keyframes = t_ns[::70]
    noise = ImuNoise(1e-4, 1e-3)
    pairs = zip(keyframes[:-1].tolist(), keyframes[1:].tolist(), strict=True)
    factors = InertialFactors.chain([preintegrate(imu, a, b, noise) for a, b in pairs])
    seconds = keyframes * 1e-9
    return spline.p_W(seconds), spline.R_WB(seconds), spline.v_W(seconds), factors


def in_map(p_W: np.ndarray, R_WB: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The poses seen from the first body, as the front-end's map has them."""
    return (p_W - p_W[0]) @ R_WB[0], R_WB[0].T @ R_WB


@pytest.mark.parametrize("seed", range(4))
def test_exact_poses_give_velocities_roll_and_pitch(seed: int) -> None:
    """Gravity's sign, a frame of the velocities, or dt where dt^2 / 2 belongs."""
    p_W, R_WB, v_W, factors = motion(seed)
    p_M, R_MB = in_map(p_W, R_WB)
    result = align_with_gravity(p_M, R_MB, factors, G)
    assert result.free_gravity == pytest.approx(G, abs=2e-3)
    # What is left of the turn between the true first attitude and ours is about z alone.
    yaw_only = so3.log(result.R_WM @ R_WB[0].T)
    assert np.abs((result.R_WM @ R_WB[0].T)[2] - [0, 0, 1]).max() < 3e-4, yaw_only
    np.testing.assert_allclose(result.v_M @ R_WB[0].T, v_W, atol=2e-3)
    assert result.rms_position_m < 1e-3 and result.rms_velocity_mps < 1e-3


def test_noise_in_the_poses_leaves_tilt_within_a_degree() -> None:
    """An ill-weighted system: velocities that follow the jitter of the positions."""
    p_W, R_WB, v_W, factors = motion(1)
    rng = np.random.default_rng(1)
    p_M, R_MB = in_map(p_W, R_WB)
    p_M = p_M + rng.normal(0, 0.005, p_M.shape)
    R_MB = R_MB @ so3.exp(rng.normal(0, 0.002, p_M.shape))
    result = align_with_gravity(p_M, R_MB, factors, G)
    tilt = np.arccos((result.R_WM @ R_WB[0].T)[2, 2])
    assert np.degrees(tilt) < 1.0
    assert np.sqrt(np.mean((result.v_M @ R_WB[0].T - v_W) ** 2)) < 0.05
    assert abs(result.free_gravity - G) < 0.2


def test_length_of_gravity_is_held_at_what_is_known() -> None:
    """The free length used for the direction's residual: the start would disagree with the problem's g."""
    p_W, R_WB, _, factors = motion(2)
    p_M, R_MB = in_map(p_W, R_WB)
    exact, strong = (align_with_gravity(p_M, R_MB, factors, g) for g in (G, 9.9))
    assert strong.free_gravity == pytest.approx(exact.free_gravity)
    assert strong.rms_position_m > 2 * exact.rms_position_m


@pytest.mark.parametrize("fault", ["scale", "frame"])
def test_poses_that_do_not_belong_to_the_samples_are_refused(fault: str) -> None:
    """Positions in another unit, or extrinsics left out: a wild start instead of an error."""
    p_W, R_WB, _, factors = motion(3)
    p_M, R_MB = in_map(p_W, R_WB)
    if fault == "scale":
        p_M = 1000.0 * p_M
    else:
        R_MB = R_MB @ so3.exp(np.array([0.0, np.pi, 0.0])) @ R_MB
        p_M = 40.0 * p_M
    with pytest.raises(VigaugeError, match="gravity"):
        align_with_gravity(p_M, R_MB, factors, G)


vectors = arrays(float, 3, elements=st.floats(-10, 10)).filter(lambda v: np.linalg.norm(v) > 1e-3)


@given(vectors, vectors)
def test_turn_brings_one_direction_onto_the_other_by_the_least_angle(a: np.ndarray, b: np.ndarray) -> None:
    """A turn about any other axis would add yaw; opposite directions would divide by zero."""
    R = turn_onto(a, b)
    unit_a, unit_b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    np.testing.assert_allclose(R @ unit_a, unit_b, atol=1e-9)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    angle = np.arctan2(np.linalg.norm(np.cross(unit_a, unit_b)), unit_a @ unit_b)
    assert np.linalg.norm(so3.log(R)) == pytest.approx(angle, abs=1e-7)


@pytest.mark.parametrize("axis", range(3))
def test_turn_onto_the_opposite_and_onto_itself(axis: int) -> None:
    """The two directions for which the cross product vanishes."""
    e = np.eye(3)[axis]
    np.testing.assert_allclose(turn_onto(e, -2.0 * e) @ e, -e, atol=1e-12)
    np.testing.assert_array_equal(turn_onto(e, 3.0 * e), np.eye(3))
