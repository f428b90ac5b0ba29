"""Robust losses: cost, weights and gradient by their definitions, in the solver, in H, and refused."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import vigauge as vg
from support.dense import dense_jacobian, dense_residual
from support.derivatives import central_differences
from support.random_problem import random_problem
from support.simulated import scene, trial, with_outliers
from vigauge.model.loss import Loss
from vigauge.solver.normal_equations import linearise
from vigauge.solver.residuals import cost, evaluate, visual_residual

LOSSES = [vg.Huber(1.5), vg.Cauchy(2.0)]


def rho_and_weight(loss: Loss, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """rho and rho' as Ceres' documentation prints them, for delta = 1, scaled."""
    d2 = loss.delta**2
    if isinstance(loss, vg.Cauchy):
        return d2 * np.log(1.0 + s / d2), 1.0 / (1.0 + s / d2)
    return d2 * np.where(s <= d2, s / d2, 2.0 * np.sqrt(s / d2) - 1.0), np.where(
        s <= d2, 1.0, loss.delta / np.sqrt(np.maximum(s, d2))
    )


def problems(loss: Loss) -> list[vg.Problem]:
    """Two cameras and a jumping factor; a flight with outliers. Errors on both sides of delta."""
    mixed = random_problem(3)
    s = np.sum(visual_residual(mixed, mixed.initial) ** 2, axis=1)
    return [
        replace(mixed, loss=replace(loss, delta=float(np.sqrt(np.median(s))))),
        with_outliers(trial(), loss),
    ]


@pytest.mark.parametrize("case", [0, 1])
@pytest.mark.parametrize("loss", LOSSES, ids=repr)
def test_cost_weights_and_gradient_by_definition(loss, case):
    """Catches a loss of single coordinates, weights squared or missing in H, a pull that is not rho' r."""
    problem = problems(loss)[case]
    state = problem.initial
    J, r = dense_jacobian(problem, state), dense_residual(problem, state)
    visual = visual_residual(problem, state)
    rho, weight = rho_and_weight(problem.loss, np.sum(visual**2, axis=1))
    inertial = r[visual.size :]
    assert cost(problem, state) == pytest.approx(0.5 * (rho.sum() + inertial @ inertial), rel=1e-13)
    w = np.concatenate([np.repeat(weight, 2), np.ones(len(inertial))])[:, None]
    equations = linearise(problem, state)
    scale = np.linalg.norm(np.sqrt(w) * J, axis=0)
    assert np.abs((equations.dense() - J.T @ (w * J)) / scale[:, None] / scale).max() < 1e-12
    assert np.abs((equations.gradient - J.T @ (w[:, 0] * r)) / scale).max() < 1e-12 * np.linalg.norm(r)
    plain = evaluate(replace(problem, loss=None), state).mean_reprojection_px
    assert evaluate(problem, state).mean_reprojection_px == pytest.approx(plain, rel=1e-13)


@pytest.mark.parametrize("loss", LOSSES, ids=repr)
def test_gradient_is_that_of_the_cost(loss):
    """Catches a cost and a step that minimise two things: the gradient against differences of the cost."""
    problem = with_outliers(trial(), loss)
    state = vg.solve(problem, vg.FreeGauge(), vg.Options(maximum_iterations=4)).state
    numeric = central_differences(lambda delta: cost(problem, state.retract(delta)), state.n_parameters, 1e-5)
    scale = np.sqrt(linearise(problem, state).diagonal())
    error = (linearise(problem, state).gradient - numeric) / scale
    assert np.abs(error).max() < 1e-6 * np.abs(numeric / scale).max()


@given(factor=st.floats(1.0, 1e90))
def test_a_huge_delta_is_no_loss(factor):
    """Catches digits lost in rho where s / delta^2 is below rounding, and squares of delta that overflow."""
    problem = trial()
    plain, state = linearise(problem, problem.initial), problem.initial
    for loss in (vg.Huber(1e4 * factor), vg.Cauchy(1e9 * factor)):
        same = replace(problem, loss=loss)
        assert cost(same, state) == pytest.approx(cost(problem, state), rel=1e-12)
        assert vg.relative_frobenius(linearise(same, state).dense(), plain.dense()) < 1e-12


def test_a_tiny_delta_takes_the_images_away():
    """Catches a division by the square of a small delta."""
    for loss in (vg.Huber(1e-100), vg.Cauchy(1e-100)):
        problem = replace(trial(), loss=loss)
        inertial = replace(trial(), sigma_px=1e150)
        found = cost(problem, problem.initial)
        assert found == pytest.approx(cost(inertial, problem.initial), rel=1e-9)


@pytest.mark.parametrize("loss", LOSSES, ids=repr)
def test_outliers_pull_less(loss):
    """Catches a loss that changes nothing: errors against the truth, and what is said of outliers."""
    problem = with_outliers(trial(), loss)
    options = vg.Options(function_tolerance=1e-9, maximum_iterations=200)
    robust = vg.solve(problem, vg.FixedGauge(), options)
    squares = vg.solve(replace(problem, loss=None), vg.FixedGauge(), options)
    errors = [vg.trajectory_errors(s.state, scene().truth).p_rmse_m for s in (robust, squares)]
    assert robust.converged and errors[0] < 0.5 * errors[1], errors
    length = np.linalg.norm(visual_residual(problem, robust.state), axis=1)
    count = int(np.sum(length > loss.delta))
    assert 0.1 * len(length) < robust.down_weighted == count < 0.5 * len(length)
    assert squares.down_weighted == 0
    assert f"{count} reprojection errors are down-weighted" in vg.diagnose(problem, robust.state).sentence
    assert "down-weighted" not in vg.diagnose(replace(problem, loss=None), robust.state).sentence


@pytest.mark.parametrize("loss", LOSSES, ids=repr)
def test_a_landmark_at_depth_zero_has_no_cost(loss):
    """Catches a loss that makes a number of infinity."""
    problem = replace(trial(), loss=loss)
    i, camera = problem.obs_keyframe[0], problem.cameras[problem.obs_camera[0]]
    X_W = problem.initial.X_W.copy()
    X_W[problem.obs_landmark[0]] = problem.initial.p_W[i] + problem.initial.R_WB[i] @ camera.p_BC
    assert not np.isfinite(cost(problem, replace(problem.initial, X_W=X_W)))


@pytest.mark.parametrize("kind", [vg.Huber, vg.Cauchy])
@pytest.mark.parametrize(
    ("delta", "rule"),
    [
        (0.0, "must be positive"),
        (-1.0, "must be positive"),
        (np.nan, "must be a finite number"),
        (np.inf, "must be a finite number"),
        (True, "must be a finite number"),
        ("2", "must be a finite number"),
        (None, "must be a finite number"),
        (1e-101, "must lie in 1e-100..1e+100"),
        (1e101, "must lie in 1e-100..1e+100"),
    ],
)
def test_refusals(kind, delta, rule):
    """Catches a delta whose weights are negative, NaN or of another number."""
    with pytest.raises(vg.DataError) as caught:
        kind(delta)
    assert f"{kind.__name__}, delta: {rule}" in str(caught.value)


@pytest.mark.parametrize("loss", [2.0, "huber", vg.Huber, Loss(1.0)], ids=str)
def test_a_loss_that_is_none_is_refused(loss):
    with pytest.raises(
        vg.DataError, match=r"problem, loss: must be vg.Huber\(delta\), vg.Cauchy\(delta\) or None"
    ):
        replace(trial(), loss=loss)
