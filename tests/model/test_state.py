"""States: the retraction of Eqs. (8)-(9), the gauge group of Eqs. (4)-(5), and bad input."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.random_problem import random_state
from vigauge.errors import DataError
from vigauge.geometry import so3
from vigauge.model.state import State

STATE = random_state(np.random.default_rng(3))
yaw = st.floats(-3.1, 3.1)
shift = st.tuples(*[st.floats(-10.0, 10.0)] * 3).map(np.array)

BIASED = STATE.with_biases(np.array([0.1, -0.2, 0.3]), np.arange(3.0 * STATE.n_keyframes).reshape(-1, 3))


def same(a: State, b: State, tolerance: float = 1e-13) -> bool:
    return all(
        np.allclose(getattr(a, name), getattr(b, name), rtol=0.0, atol=tolerance)
        for name in ("p_W", "R_WB", "v_W", "X_W", "dphi_0", "R_WB0_ref")
    )


def test_retraction_moves_each_parameter_as_stated():
    """Catches another order of the parameters, right increments, or Eq. (8) used for keyframe 0."""
    n, k = STATE.n_keyframes, STATE.n_landmarks
    assert STATE.n_parameters == 9 * n + 3 * k
    delta = np.random.default_rng(4).normal(0.0, 0.2, STATE.n_parameters)
    d_p, d_phi, d_v = delta[: 9 * n].reshape(3, n, 3)
    moved = STATE.retract(delta)
    assert np.array_equal(moved.p_W, STATE.p_W + d_p)
    assert np.array_equal(moved.v_W, STATE.v_W + d_v)
    assert np.array_equal(moved.X_W, STATE.X_W + delta[9 * n :].reshape(k, 3))
    for i in range(1, n):
        assert np.allclose(moved.R_WB[i], so3.exp(d_phi[i]) @ STATE.R_WB[i], rtol=0, atol=1e-15)
    assert np.array_equal(moved.dphi_0, STATE.dphi_0 + d_phi[0])
    assert np.allclose(moved.R_WB[0], so3.exp(STATE.dphi_0 + d_phi[0]) @ STATE.R_WB0_ref, rtol=0, atol=1e-15)


def test_retraction_leaves_the_state_alone():
    """Catches an update in place, which would spoil rejected steps."""
    before = {name: array.copy() for name, array in vars(BIASED).items()}
    BIASED.retract(np.ones(BIASED.n_parameters))
    assert all(np.array_equal(before[name], array) for name, array in vars(BIASED).items())


@given(st.integers(0, 10**6))
def test_local_undoes_retract(seed):
    """Catches a difference of states that is not the inverse of moving them."""
    for state in (STATE, BIASED):
        delta = np.random.default_rng(seed).normal(0.0, 0.3, state.n_parameters)
        assert np.allclose(state.local(state.retract(delta)), delta, rtol=0, atol=1e-13)


def test_biases_stand_between_velocities_and_landmarks():
    """Catches biases moved by another part of the step, turned with the world, or lost on the way."""
    n = BIASED.n_keyframes
    assert BIASED.n_parameters == STATE.n_parameters + 6 * n
    delta = np.zeros(BIASED.n_parameters)
    delta[9 * n : 15 * n] = np.arange(6 * n)
    moved = BIASED.retract(delta).transformed(0.3, np.ones(3))
    assert np.allclose(moved.gyro_bias - BIASED.gyro_bias, np.arange(3.0 * n).reshape(n, 3))
    assert np.allclose(moved.accel_bias - BIASED.accel_bias, np.arange(3.0 * n, 6.0 * n).reshape(n, 3))
    assert same(moved, STATE.transformed(0.3, np.ones(3)))


@pytest.mark.parametrize(
    ("biases", "rule"),
    [
        ({"gyro_bias": None}, "other bias"),
        ({"accel_bias": np.zeros((2, 3))}, "shape"),
        ({"gyro_bias": np.full((STATE.n_keyframes, 3), np.nan)}, "finite"),
    ],
)
def test_bad_biases_are_refused(biases, rule):
    """Catches one bias without the other, or NaN in the state where a solve begins."""
    with pytest.raises(DataError, match=rule):
        replace(BIASED, **biases).require_valid()


def test_states_with_and_without_biases_do_not_mix():
    """Catches an increment of another length, or biases taken for landmarks."""
    for a, b in ((STATE, BIASED), (BIASED, STATE)):
        with pytest.raises(DataError, match="bias"):
            a.local(b)


def test_iterated_increments_do_not_hold_the_yaw_but_the_total_one_does():
    """Catches (8) used for the first rotation: increments without z part still add up to a turn
    about z (Section III-A), while in (9) the z part of the total stays what it is."""
    increments = np.array([[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [-0.1, 0.0, 0.0], [0.0, -0.1, 0.0]])
    iterated = np.eye(3)
    state = State.start(np.zeros((1, 3)), np.eye(3)[None], np.zeros((1, 3)), np.zeros((0, 3)))
    for increment in increments:
        iterated = so3.exp(increment) @ iterated
        state = state.retract(np.concatenate([np.zeros(3), increment, np.zeros(3)]))
        assert state.dphi_0[2] == 0.0
        assert abs(so3.log(state.R_WB[0] @ state.R_WB0_ref.T)[2]) < 1e-16
    assert abs(so3.log(iterated)[2]) > 0.009  # about the enclosed area, 0.1 x 0.1


@given(yaw, shift)
def test_transformation_acts_as_the_group(alpha, t_W):
    """Catches a wrong action of g on any part of the state, Eq. (5)."""
    R_z = so3.yaw_rotation(alpha)
    moved = STATE.transformed(alpha, t_W)
    for i in range(STATE.n_keyframes):
        assert np.allclose(moved.p_W[i], R_z @ STATE.p_W[i] + t_W, atol=1e-14)
        assert np.allclose(moved.R_WB[i], R_z @ STATE.R_WB[i], atol=1e-15)
        assert np.allclose(moved.v_W[i], R_z @ STATE.v_W[i], atol=1e-14)
    for j in range(STATE.n_landmarks):
        assert np.allclose(moved.X_W[j], R_z @ STATE.X_W[j] + t_W, atol=1e-14)
    assert np.allclose(moved.R_WB[0], so3.exp(moved.dphi_0) @ moved.R_WB0_ref, atol=1e-14)


@given(yaw, shift, yaw, shift)
def test_transformations_compose(alpha, t_W, beta, s_W):
    """Catches an action that is no group action: g2(g1(theta)) = (g2 g1)(theta), and inverses."""
    twice = STATE.transformed(alpha, t_W).transformed(beta, s_W)
    at_once = STATE.transformed(alpha + beta, so3.yaw_rotation(beta) @ t_W + s_W)
    # dphi_0 of a turn beyond pi has another representative; compare what it stands for.
    for name in ("p_W", "R_WB", "v_W", "X_W"):
        assert np.allclose(getattr(twice, name), getattr(at_once, name), rtol=0, atol=1e-13)
    assert np.allclose(so3.exp(twice.dphi_0), so3.exp(at_once.dphi_0), atol=1e-13)
    back = STATE.transformed(alpha, t_W).transformed(-alpha, -so3.yaw_rotation(-alpha) @ t_W)
    assert same(back, STATE)


def test_start_copies_and_begins_at_its_reference():
    """Catches aliasing of the caller's arrays and a first increment that is not zero."""
    p_W, R_WB = np.zeros((2, 3)), np.stack([np.eye(3)] * 2)
    state = State.start(p_W, R_WB, np.zeros((2, 3)), np.zeros((0, 3)))
    p_W += 1.0
    R_WB[0] = 0.0
    assert np.array_equal(state.p_W, np.zeros((2, 3)))
    assert np.array_equal(state.R_WB[0], np.eye(3))
    assert np.array_equal(state.dphi_0, np.zeros(3))
    assert np.array_equal(state.R_WB0_ref, np.eye(3))


def _nan(array: np.ndarray) -> np.ndarray:
    array = array.copy()
    array[1] = np.nan
    return array


@pytest.mark.parametrize(
    ("field", "change", "row", "rule"),
    [
        ("p_W", lambda a: a[:, :2], None, "shape"),
        ("v_W", lambda a: a[1:], None, "shape"),
        ("R_WB", lambda a: a[:, :2], None, "shape"),
        ("p_W", _nan, 1, "finite"),
        ("X_W", _nan, 1, "finite"),
        ("R_WB", _nan, 1, "finite"),
        ("R_WB", lambda a: a * np.array([1.0, 1.0, -1.0]), None, "rotation"),
        ("R_WB", lambda a: a * 1.001, None, "rotation"),
    ],
)
def test_start_refuses_bad_arrays(field, change, row, rule):
    """Catches bad numbers let into the solver: the message names array, row and rule."""
    arrays = {name: getattr(STATE, name) for name in ("p_W", "R_WB", "v_W", "X_W")}
    arrays[field] = change(arrays[field])
    with pytest.raises(DataError, match=rule) as caught:
        State.start(**arrays)
    if field != "p_W" or rule != "shape":
        assert caught.value.field == field
    if row is not None:
        assert caught.value.row == row
    assert caught.value.file == "state"


def test_start_refuses_an_empty_trajectory():
    """Catches an index error instead of a message where there are no keyframes."""
    with pytest.raises(DataError, match="keyframe"):
        State.start(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros((0, 3)))


def test_an_increment_beyond_numbers_is_refused_without_overflow():
    """Catches a warning, or an infinite norm, where a hostile archive holds 1e300 rad."""
    state = random_state(np.random.default_rng(0))
    with pytest.raises(DataError, match=r"dphi_0: must be below 1e\+100"):
        replace(state, dphi_0=np.full(3, 1e300)).require_valid()
