"""Errors after 4-DoF alignment, and the comparison of covariances."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.derivatives import central_differences
from support.random_problem import random_state
from vigauge.errors import VigaugeError
from vigauge.geometry import so3
from vigauge.model.evaluation import (
    CovarianceDefects,
    align_all_poses,
    align_first_pose,
    covariance_defects,
    relative_frobenius,
    trajectory_errors,
)

TRUTH = random_state(np.random.default_rng(21), 6, 3)
yaw = st.floats(-3.1, 3.1)
shift = st.tuples(*[st.floats(-10.0, 10.0)] * 3).map(np.array)


def disturbed(rng: np.random.Generator, size: float = 0.05):
    return TRUTH.retract(rng.normal(0.0, size, TRUTH.n_parameters))


@given(yaw, shift)
def test_a_gauge_transformation_is_no_error(alpha, t_W):
    """Catches an alignment that leaves part of the gauge in the error."""
    errors = trajectory_errors(TRUTH.transformed(alpha, t_W), TRUTH)
    assert errors.p_rmse_m < 1e-13
    assert errors.phi_rmse_rad < 1e-13
    assert errors.v_rmse_mps < 1e-13


@given(yaw, shift, st.integers(0, 100))
def test_errors_do_not_depend_on_the_gauge(alpha, t_W, seed):
    """Catches errors that a free-gauge estimate would be charged with."""
    estimate = disturbed(np.random.default_rng(seed))
    here, there = (trajectory_errors(s, TRUTH) for s in (estimate, estimate.transformed(alpha, t_W)))
    for name in ("p_rmse_m", "phi_rmse_rad", "v_rmse_mps"):
        assert getattr(there, name) == pytest.approx(getattr(here, name), rel=1e-11)


def test_alignment_joins_the_first_poses():
    """Catches an alignment over all poses: the first position and yaw agree exactly, tilt stays."""
    estimate = disturbed(np.random.default_rng(1))
    aligned = align_first_pose(estimate, TRUTH)
    assert np.allclose(aligned.p_W[0], TRUTH.p_W[0], rtol=0, atol=1e-14)
    q = so3.quaternion(aligned.R_WB[0] @ TRUTH.R_WB[0].T)
    assert abs(q[3]) < 1e-15
    assert np.linalg.norm(q[1:3]) > 1e-3
    assert np.allclose(np.diff(aligned.p_W[:, 2]), np.diff(estimate.p_W[:, 2]), rtol=0, atol=1e-14)


def test_alignment_may_turn_by_pi():
    """Catches a yaw that folds at half a turn."""
    aligned = align_first_pose(TRUTH.transformed(np.pi, np.zeros(3)), TRUTH)
    assert np.allclose(aligned.p_W, TRUTH.p_W, rtol=0, atol=1e-13)


def test_alignment_of_all_poses_is_the_best_one():
    """Catches a yaw of the wrong sign, or a shift by the first pose: no other 4-DoF transformation
    brings the positions closer."""
    estimate = disturbed(np.random.default_rng(2)).transformed(2.5, np.array([4.0, -1.0, 2.0]))
    aligned = align_all_poses(estimate, TRUTH)
    best = np.sum((aligned.p_W - TRUTH.p_W) ** 2)
    assert best < 0.1

    def distance(change):
        return np.sum((aligned.transformed(change[0], change[1:]).p_W - TRUTH.p_W) ** 2, keepdims=True)

    assert np.abs(central_differences(distance, 4)).max() < 1e-9
    for change in np.random.default_rng(3).normal(0.0, 1.0, (20, 4)):
        assert distance(change) > best
    by_all = trajectory_errors(estimate, TRUTH, align_all_poses)
    assert by_all.p_rmse_m == pytest.approx(np.sqrt(best / TRUTH.n_keyframes), rel=1e-12)
    assert by_all.p_rmse_m < trajectory_errors(estimate, TRUTH).p_rmse_m


@given(yaw, shift)
def test_alignment_of_all_poses_does_not_see_the_gauge(alpha, t_W):
    """Catches an alignment that leaves part of the gauge in the error."""
    errors = trajectory_errors(TRUTH.transformed(alpha, t_W), TRUTH, align_all_poses)
    assert max(errors.p_rmse_m, errors.phi_rmse_rad, errors.v_rmse_mps) < 1e-13


def test_errors_of_a_known_disturbance():
    """Catches a mean instead of a root mean square, per axis instead of per pose, or a wrong unit."""
    n = TRUTH.n_keyframes
    p_W, v_W, R_WB = TRUTH.p_W.copy(), TRUTH.v_W.copy(), TRUTH.R_WB.copy()
    p_W[1] += [0.3, 0.0, 0.4]
    v_W[2] += [0.0, 0.6, 0.8]
    R_WB[3] = so3.exp([0.0, np.radians(9.0), 0.0]) @ R_WB[3]
    errors = trajectory_errors(replace(TRUTH, p_W=p_W, v_W=v_W, R_WB=R_WB), TRUTH)
    assert errors.p_rmse_m == pytest.approx(0.5 / np.sqrt(n), rel=1e-12)
    assert errors.v_rmse_mps == pytest.approx(1.0 / np.sqrt(n), rel=1e-12)
    assert errors.phi_rmse_deg == pytest.approx(9.0 / np.sqrt(n), rel=1e-12)
    assert errors.phi_rmse_rad == pytest.approx(np.radians(9.0) / np.sqrt(n), rel=1e-12)


def test_keyframes_must_match():
    """Catches broadcasting of one trajectory over another."""
    with pytest.raises(VigaugeError, match="same keyframes.*6.*1"):
        trajectory_errors(TRUTH, random_state(np.random.default_rng(0), 1, 1))


def test_relative_frobenius_is_over_the_reference():
    """Catches the other denominator: ||A - B|| / ||B||, as in the captions of Figs. 9 and 10."""
    A, B = np.diag([3.0, 0.0]), np.diag([1.0, 0.0])
    assert relative_frobenius(A, B) == pytest.approx(2.0)
    assert relative_frobenius(B, A) == pytest.approx(2.0 / 3.0)


def test_a_yaw_without_meaning_is_refused():
    """Turned by pi about a level axis there is no twist about the vertical, only rounding errors."""
    truth = random_state(np.random.default_rng(5))
    turn = so3.exp(np.pi * np.array([np.cos(0.4), np.sin(0.4), 0.0]))
    upside_down = replace(truth, R_WB=turn @ truth.R_WB)
    with pytest.raises(VigaugeError, match="yaw between estimate and truth is undefined"):
        align_first_pose(upside_down, truth)


def test_defects_of_covariances_are_measured_whatever_the_units():
    """An asymmetric or indefinite matrix that passes for a covariance because its entries are small."""
    rng = np.random.default_rng(6)
    root = rng.normal(size=(6, 6)) * np.array([1e-6, 1e-3, 1.0, 1.0, 10.0, 1e3])[:, None]
    good = root @ root.T
    good[5] = good[:, 5] = 0.0  # held
    assert covariance_defects(good) == CovarianceDefects(0.0, pytest.approx(0.0, abs=1e-14))
    bad = good.copy()
    bad[0, 1] *= 1.1
    assert covariance_defects(bad).asymmetry > 0.0
    bad = good.copy()
    bad[0, 1] = bad[1, 0] = 2.0 * np.sqrt(good[0, 0] * good[1, 1])
    assert covariance_defects(bad).negativity > 0.1
    assert covariance_defects(-good).negativity == 1.0
    assert covariance_defects(np.zeros((3, 3))) == CovarianceDefects(0.0, 0.0)
