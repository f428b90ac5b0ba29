"""Gauges: the orbit's tangent, the constraints' normals, and where an orbit meets a gauge."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.derivatives import central_differences
from support.gauged import spectrum
from support.random_problem import random_problem, random_state
from support.simulated import estimate, trial
from vigauge.covariance.projection import oblique_projector
from vigauge.errors import VigaugeError
from vigauge.gauge.gauges import (
    CentroidGauge,
    FixedGauge,
    FreeGauge,
    KeyframeGauge,
    PriorGauge,
    yaw_to_first_pose,
)
from vigauge.gauge.group import orbit_tangent
from vigauge.geometry import so3
from vigauge.model.state import State
from vigauge.solver.normal_equations import linearise

STATE = random_state(np.random.default_rng(11), 5, 6)
CONFIGURATIONS = [(shape, points) for shape in ("sine", "arc", "rec") for points in ("plane", "random")]
GAUGES = [
    FixedGauge(),
    PriorGauge(1e5),
    FreeGauge(),
    KeyframeGauge(index=0),
    KeyframeGauge(index=3),
    CentroidGauge(),
]
tilts = st.tuples(*[st.floats(-1.7, 1.7)] * 3).map(np.array)


def scaled(H: np.ndarray) -> np.ndarray:
    scale = 1.0 / np.sqrt(np.diagonal(H))
    return H * scale[:, None] * scale


def test_tangent_is_the_derivative_of_the_group_action():
    """Catches any wrong row of (15), the first rotation's J_l^-1 included: compared with differences
    of g along yaw and the three translations."""
    numeric = central_differences(lambda d: STATE.local(STATE.transformed(d[0], d[1:])), 4)
    assert np.linalg.norm(STATE.dphi_0) > 0.4
    assert np.abs(orbit_tangent(STATE) - numeric).max() < 1e-9


@pytest.mark.parametrize(("shape", "points"), CONFIGURATIONS)
def test_the_orbit_is_the_null_space(shape, points):
    """Catches a Jacobian that breaks the invariance: H U = 0 at the minimum and at the start."""
    problem = trial(0, shape, points)
    for state in (problem.initial, estimate(0, shape, points)):
        H, U = linearise(problem, state).dense(), orbit_tangent(state)
        scale = np.sqrt(np.diagonal(H))
        leak = np.linalg.norm(H @ U / scale[:, None], axis=0) / np.linalg.norm(scale[:, None] * U, axis=0)
        assert leak.max() < 1e-13


@pytest.mark.parametrize(("shape", "points"), CONFIGURATIONS)
def test_there_are_four_null_directions_and_no_fifth(shape, points, record_property):
    """Catches a fifth unobservable direction, or a fourth that is not quite: the gap of the
    Jacobi-scaled reduced H between its fourth and fifth singular value is above 1e8."""
    problem, state = trial(0, shape, points), estimate(0, shape, points)
    found = spectrum(linearise(problem, state))
    record_property("gap", float(found.gap))
    assert found.nullity == 4
    assert found.gap > 1e8
    assert found.rank == state.n_parameters - 4
    assert found.eigenvalues[4] > 1e-6


def test_the_spectrum_is_that_of_the_dense_hessian():
    """Catches a rank counted on another matrix: by the dense, scaled H and its singular values."""
    problem, state = trial(0, "arc"), estimate(0, "arc")
    H = scaled(linearise(problem, state).dense())
    singular = np.linalg.svd(H, compute_uv=False)[::-1]
    assert singular[4] / singular[3] > 1e8
    assert np.linalg.matrix_rank(H, hermitian=True) == spectrum(linearise(problem, state)).rank


def test_spectrum_of_the_other_gauges():
    """Catches a rank of Table I counted wrongly: n - 4 columns held out, n with a prior; full both."""
    problem, state = trial(), estimate()
    equations = linearise(problem, state)
    fixed = spectrum(equations, FixedGauge().held(state))
    assert fixed.nullity == 0
    assert fixed.rank == state.n_parameters - 4
    prior = PriorGauge(1e5).prior(state, problem.initial)
    with_prior = spectrum(equations.with_factor(prior))
    assert with_prior.nullity == 0
    assert with_prior.rank == state.n_parameters


def turn_direction(state: State, axis: np.ndarray) -> np.ndarray:
    """Tangent of turning the whole scene about an axis through the centroid of the keyframes."""
    centre = state.p_W.mean(axis=0)
    n = state.n_keyframes
    rotation = np.tile(axis, (n, 1))
    rotation[0] = so3.left_jacobian_inverse(state.dphi_0) @ axis
    return np.concatenate(
        [
            np.cross(axis, state.p_W - centre).ravel(),
            rotation.ravel(),
            np.cross(axis, state.v_W).ravel(),
            np.cross(axis, state.X_W - centre).ravel(),
        ]
    )


@pytest.mark.parametrize(("shape", "points"), CONFIGURATIONS)
def test_roll_and_pitch_are_observable(shape, points):
    """Catches a lost gravity: the turn about the vertical is flat, those about level axes are not."""
    problem, state = trial(0, shape, points), estimate(0, shape, points)
    H = linearise(problem, state).dense()

    def stiffness(axis):
        u = turn_direction(state, axis)
        return (u @ H @ u) / (u**2 @ np.diagonal(H))

    roll, pitch, yaw = (abs(stiffness(axis)) for axis in np.eye(3))
    assert yaw < 1e-13
    assert min(roll, pitch) > 1e-6
    assert min(roll, pitch) > 1e8 * yaw


@pytest.mark.parametrize("gauge", GAUGES, ids=lambda g: f"{g.name}{getattr(g, 'index', '')}")
def test_gauges_cut_the_orbit(gauge):
    """Catches a gauge that is tangent to the orbit, so that (V^T U) of (14) has no inverse."""
    U, V = orbit_tangent(STATE), gauge.normal(STATE)
    assert V.shape == (STATE.n_parameters, 4)
    assert np.linalg.cond(V.T @ U) < 1e5
    Q = oblique_projector(U, V)
    assert np.abs(Q @ U).max() < 1e-12
    assert np.abs(V.T @ Q).max() < 1e-12
    assert np.abs(Q @ Q - Q).max() < 1e-12


def test_normal_of_the_first_pose_is_the_derivative_of_its_constraint():
    """Catches a V that is not dc/dtheta of Eq. (10)."""

    def constraint(delta):
        moved = STATE.retract(delta)
        return np.append(moved.p_W[0] - STATE.p_W[0], moved.dphi_0[2])

    numeric = central_differences(constraint, STATE.n_parameters).T
    for gauge in (FixedGauge(), PriorGauge(3.0)):
        assert np.abs(gauge.normal(STATE) - numeric).max() < 1e-10


@pytest.mark.parametrize("index", [0, 3])
def test_normal_of_a_keyframe_is_the_derivative_of_its_constraint(index):
    """Catches columns of another keyframe, and the first rotation's own parametrisation forgotten."""

    def constraint(delta):
        moved = STATE.retract(delta)
        return np.append(moved.p_W[index], so3.log(moved.R_WB[index] @ STATE.R_WB[index].T)[2])

    numeric = central_differences(constraint, STATE.n_parameters).T
    assert np.abs(KeyframeGauge(index=index).normal(STATE) - numeric).max() < 1e-9


def test_normal_of_the_centroid_is_the_derivative_of_its_constraint():
    """Catches the first rotation's own parametrisation forgotten in the mean yaw."""

    def constraint(delta):
        moved = STATE.retract(delta)
        turns = so3.log(moved.R_WB @ STATE.R_WB.swapaxes(1, 2))
        return np.append(moved.p_W.mean(axis=0), turns[:, 2].mean())

    numeric = central_differences(constraint, STATE.n_parameters).T
    assert np.abs(CentroidGauge().normal(STATE) - numeric).max() < 1e-10


def test_free_gauge_is_normal_to_the_orbit():
    """Catches a free gauge that prefers some direction: its projector is the orthogonal one."""
    Q = oblique_projector(orbit_tangent(STATE), FreeGauge().normal(STATE))
    assert np.abs(Q - Q.T).max() < 1e-12


def test_what_each_gauge_holds_and_adds():
    """Catches a gauge that does two things at once, or nothing."""
    n = STATE.n_keyframes
    assert FixedGauge().held(STATE).tolist() == [0, 1, 2, 3 * n + 2]
    for gauge in GAUGES[1:]:
        assert gauge.held(STATE).size == 0
    for gauge in GAUGES:
        assert (gauge.prior(STATE, STATE) is not None) == isinstance(gauge, PriorGauge)
    assert len({gauge.name for gauge in GAUGES}) == 5


@given(tilts, st.floats(-3.1, 3.1))
def test_swing_twist_solves_the_yaw_exactly(dphi_0, yaw):
    """Catches an approximate yaw: after the turn of (13) the rotation vector has no z part at all."""
    state = replace(STATE, dphi_0=dphi_0, R_WB0_ref=np.eye(3)).transformed(yaw, np.zeros(3))
    q = so3.quaternion(so3.exp(state.dphi_0))
    alpha = yaw_to_first_pose(state)
    remaining = so3.log(so3.yaw_rotation(alpha) @ so3.exp(state.dphi_0))
    assert abs(remaining[2]) < 2e-15 / min(1.0, np.hypot(q[0], q[3]))


def test_undefined_yaw_is_refused():
    """Catches a yaw of noise: turned by pi about a level axis, any yaw would do."""
    state = replace(STATE, dphi_0=np.array([np.pi, 0.0, 0.0]))
    with pytest.raises(VigaugeError, match="undefined"):
        yaw_to_first_pose(state)


@pytest.mark.parametrize("gauge", [FixedGauge(), PriorGauge(1e5)], ids=lambda g: g.name)
def test_where_the_orbit_meets_the_first_pose(gauge):
    """Catches a move that leaves the orbit, or stops before Eq. (10) holds."""
    problem = random_problem(4)
    reference = problem.initial.transformed(0.3, np.array([1.0, 2.0, 3.0]))
    reference = replace(reference, dphi_0=np.zeros(3), R_WB0_ref=reference.R_WB[0])
    state = problem.initial
    moved, yaw = gauge.meet(state, reference)
    assert np.allclose(moved.p_W[0], reference.p_W[0], rtol=0, atol=1e-14)
    assert abs(moved.dphi_0[2]) < 1e-15
    again = state.transformed(yaw, moved.p_W[0] - so3.yaw_rotation(yaw) @ state.p_W[0])
    assert np.allclose(moved.X_W, again.X_W, rtol=0, atol=1e-14)
    assert np.allclose(moved.R_WB, again.R_WB, rtol=0, atol=1e-14)
    assert np.allclose(moved.R_WB[0], so3.exp(moved.dphi_0) @ moved.R_WB0_ref, atol=1e-14)


@pytest.mark.parametrize("gauge", GAUGES[2:], ids=lambda g: f"{g.name}{getattr(g, 'index', '')}")
def test_gauges_without_a_fixed_place_stay(gauge):
    """Catches an estimate moved although every point of the orbit will do."""
    moved, yaw = gauge.meet(STATE, STATE)
    assert moved is STATE
    assert yaw == 0.0


@pytest.mark.parametrize("index", [-1, 5])
def test_a_keyframe_that_is_not_there(index):
    """Catches a negative index that counts from the end."""
    with pytest.raises(VigaugeError, match="not among"):
        KeyframeGauge(index=index).normal(STATE)
