"""Residuals against their definitions, and every Jacobian block against central differences."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from support.dense import columns_of, dense_jacobian, dense_residual, kinds_of
from support.derivatives import central_differences
from support.plain_residuals import inertial_term, visual_term
from support.random_problem import random_problem, with_noise_of_its_own
from support.simulated import SETTINGS, estimate, scene, trial
from vigauge.gauge.gauges import FixedGauge, FreeGauge, PriorGauge
from vigauge.geometry import so3
from vigauge.solver.residuals import cost, evaluate, inertial_residual, mean_reprojection_px, visual_residual
from vigauge.synthetic.scenario import make_trial

SEEDS = range(4)
CASES = [(seed, False) for seed in SEEDS] + [(seed, True) for seed in range(2)]
TRIALS = 60


def motion_kinds(state):
    return [(kind, i) for kind in kinds_of(state) for i in range(state.n_keyframes)]


@pytest.mark.parametrize("seed", SEEDS)
def test_visual_residual_by_definition(seed):
    """Catches a wrong frame, a transformation applied backwards, or observations of another row: the
    residual one by one with homogeneous matrices."""
    problem = random_problem(seed)
    state = problem.initial
    expected = []
    for i, c, j, uv in zip(
        problem.obs_keyframe, problem.obs_camera, problem.obs_landmark, problem.obs_uv, strict=True
    ):
        camera, T_WB = problem.cameras[c], np.eye(4)
        T_WB[:3, :3], T_WB[:3, 3] = state.R_WB[i], state.p_W[i]
        x_C = np.linalg.solve(T_WB @ camera.T_BC, np.append(state.X_W[j], 1.0))[:3]
        predicted = camera.K @ x_C / x_C[2]
        expected.append((predicted[:2] - uv) / problem.sigma_px)
    residual = visual_residual(problem, state)
    assert np.allclose(residual, expected, rtol=1e-12, atol=1e-12)
    assert np.abs(residual).mean() > 10.0
    assert mean_reprojection_px(problem, state) == pytest.approx(
        1.7 * np.mean([np.hypot(*row) for row in expected])
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_inertial_residual_by_definition(seed):
    """Catches a sign of gravity, a transposed rotation, or the order of the nine components."""
    problem = random_problem(seed)
    state, f = problem.initial, problem.inertial
    g_W = np.array([0.0, 0.0, -problem.gravity])
    residual = inertial_residual(problem, state)
    for row, (i, j) in enumerate(zip(f.first, f.second, strict=True)):
        dt, R_T = f.dt[row], state.R_WB[i].T
        shift = state.p_W[j] - state.p_W[i] - state.v_W[i] * dt - 0.5 * g_W * dt * dt
        error = np.concatenate(
            [
                R_T @ shift - f.dp[row],
                so3.log(f.dR[row].T @ R_T @ state.R_WB[j]),
                R_T @ (state.v_W[j] - state.v_W[i] - g_W * dt) - f.dv[row],
            ]
        )
        assert residual[row] @ residual[row] == pytest.approx(
            error @ np.linalg.solve(f.covariance[row], error), rel=1e-10
        )
        assert np.allclose(np.linalg.solve(f.whitener[row], residual[row]), error, rtol=1e-10)
    whitened = f.whitener @ f.covariance @ f.whitener.swapaxes(1, 2)
    assert np.allclose(whitened, np.eye(9), atol=1e-9)


@pytest.mark.parametrize(("seed", "biases"), CASES)
def test_every_jacobian_against_central_differences(seed, biases, record_property):
    """Catches any wrong block: both residuals by every position, rotation, velocity, bias and landmark, at
    large residuals, with dphi_0 away from zero and two cameras; blocks that must vanish included.

    Each 2-, 9- or 15-row block is compared with the numerical one relative to its own size.
    """
    problem = random_problem(seed, biases=biases)
    state = problem.initial
    assert np.linalg.norm(state.dphi_0) > 0.4
    analytic = dense_jacobian(problem, state)
    numeric = central_differences(
        lambda delta: dense_residual(problem, state.retract(delta)), state.n_parameters, 2e-4
    )
    count = len(problem.obs_uv)
    groups = [slice(2 * m, 2 * m + 2) for m in range(count)]
    size = state.width
    begins = 2 * count + size * np.arange(len(problem.inertial.dt))
    groups += [slice(begin, begin + size) for begin in begins]
    blocks = motion_kinds(state) + [("landmark", j) for j in range(state.n_landmarks)]
    worst = 0.0
    for rows in groups:
        whole = np.linalg.norm(numeric[rows])
        for kind, index in blocks:
            columns = columns_of(state, kind, index)
            size = np.linalg.norm(numeric[rows, columns])
            error = np.linalg.norm(analytic[rows, columns] - numeric[rows, columns])
            if not np.any(analytic[rows, columns]):
                assert size < 1e-9 * whole, (rows, kind, index)
            else:
                worst = max(worst, error / size)
                assert error < 1e-6 * size, (rows, kind, index)
    record_property("worst_relative_error", float(worst))


@pytest.mark.parametrize("seed", SEEDS)
def test_prior_jacobian_against_central_differences(seed):
    """Catches a prior whose Jacobian is not that of its residual, Eq. (11)."""
    problem = random_problem(seed)
    gauge = PriorGauge(1e5)
    reference = problem.initial.retract(
        np.random.default_rng(seed).normal(0.0, 0.1, problem.initial.n_parameters)
    )
    state = problem.initial
    prior = gauge.prior(state, reference)
    numeric = central_differences(
        lambda delta: gauge.prior(state.retract(delta), reference).residual, state.n_parameters
    )
    analytic = np.zeros_like(numeric)
    analytic[:, prior.columns] = prior.jacobian
    assert np.linalg.norm(analytic - numeric) < 1e-9 * np.linalg.norm(analytic)
    expected = np.sqrt(1e5) * np.append(state.p_W[0] - reference.p_W[0], state.dphi_0[2])
    assert np.allclose(prior.residual, expected, rtol=1e-14)
    assert FreeGauge().prior(state, reference) is None
    assert FixedGauge().prior(state, reference) is None


@pytest.mark.parametrize(("seed", "biases"), CASES)
def test_compiled_and_plain_residuals_are_the_same(seed, biases):
    """Catches a kernel that computes something else than the NumPy form, a cost or a mean of other terms, a
    noise that is another observation's."""
    problem = random_problem(seed, biases=biases)
    problem = with_noise_of_its_own(problem, seed) if seed else problem
    state = problem.initial
    found = evaluate(problem, state)
    visual, inertial = visual_term(problem, state).residual, inertial_term(problem, state).residual
    assert np.allclose(visual_residual(problem, state), visual, rtol=1e-12, atol=1e-10)
    assert np.allclose(inertial_residual(problem, state), inertial, rtol=1e-12, atol=1e-10)
    assert found.cost == pytest.approx(0.5 * (np.sum(visual**2) + np.sum(inertial**2)), rel=1e-13)
    lengths = np.linalg.norm(visual, axis=1) * problem.sigma_px
    assert found.mean_reprojection_px == pytest.approx(lengths.mean(), rel=1e-13)


@given(st.floats(-3.1, 3.1), st.tuples(*[st.floats(-10.0, 10.0)] * 3))
def test_cost_does_not_see_the_gauge(yaw, t_W):
    """Catches any dependence of a residual on the frame: J(g(theta)) = J(theta), Eq. (3)."""
    for problem, state in (
        (trial(), trial().initial),
        (random_problem(1), random_problem(1).initial),
        (random_problem(1, biases=True), random_problem(1, biases=True).initial),
        (trial(), estimate()),
    ):
        before = cost(problem, state)
        assert cost(problem, state.transformed(yaw, np.array(t_W))) == pytest.approx(before, rel=1e-12)


@pytest.mark.parametrize("axis", [0, 1])
def test_cost_sees_roll_and_pitch(axis):
    """Catches a lost gravity: turned about a level axis the whole scene must cost more."""
    problem, state = trial(), estimate()
    turn = so3.exp(0.01 * np.eye(3)[axis])
    n = state.n_keyframes
    turned = state.retract(
        np.concatenate(
            [
                (state.p_W @ turn.T - state.p_W).ravel(),
                np.zeros(3 * n),
                (state.v_W @ turn.T - state.v_W).ravel(),
                (state.X_W @ turn.T - state.X_W).ravel(),
            ]
        )
    )
    increments = np.tile(0.01 * np.eye(3)[axis], n)
    increments[:3] = so3.log(turn @ so3.exp(state.dphi_0)) - state.dphi_0
    turned = turned.retract(
        np.concatenate([np.zeros(3 * n), increments, np.zeros(3 * n + 3 * len(state.X_W))])
    )
    assert np.allclose(visual_residual(problem, turned), visual_residual(problem, state), atol=1e-8)
    assert cost(problem, turned) > 1.5 * cost(problem, state)


@pytest.mark.parametrize(("shape", "points"), [("sine", "plane"), ("arc", "random"), ("rec", "random")])
def test_whitened_residuals_at_the_truth_have_unit_variance(shape, points):
    """Catches wrong noise, a wrong whitening, or an integration error: at the truth the sum of squares
    of each of the 11 components over many trials is chi-square, within its 99 % band."""
    world = scene(shape, points)
    problems = [make_trial(world, number) for number in range(TRIALS)]
    visual = np.concatenate([visual_residual(problem, world.truth) for problem in problems])
    inertial = np.concatenate([inertial_residual(problem, world.truth) for problem in problems])
    for name, residual in (("visual", visual), ("inertial", inertial)):
        low, high = chi2.interval(0.99, len(residual))
        sums = np.sum(residual**2, axis=0)
        assert np.all((low < sums) & (sums < high)), (name, sums / len(residual), (low, high))
    assert len(inertial) == TRIALS * (SETTINGS.n_keyframes - 1)


def test_no_observations_and_no_factors_are_no_error():
    """Catches a mean or a product over nothing: inertial-only and vision-only problems."""
    problem = random_problem(0)
    state = replace(problem.initial, X_W=np.zeros((0, 3)))
    empty = np.zeros(0, dtype=np.int64)
    inertial_only = replace(
        problem,
        initial=state,
        obs_keyframe=empty,
        obs_camera=empty,
        obs_landmark=empty,
        obs_uv=np.zeros((0, 2)),
    )
    assert visual_residual(inertial_only, state).shape == (0, 2)
    assert mean_reprojection_px(inertial_only, state) == 0.0
    inertial = inertial_residual(problem, problem.initial)
    assert cost(inertial_only, state) == pytest.approx(0.5 * np.sum(inertial**2))
