"""Motion factors: the solver, the covariance and the diagnosis respect them."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from support.dense import dense_jacobian
from support.random_problem import random_problem
from vigauge.covariance.covariance import Covariance
from vigauge.covariance.projection import project_covariance
from vigauge.errors import DataError
from vigauge.gauge.gauges import CentroidGauge, FixedGauge, FreeGauge, KeyframeGauge, PriorGauge
from vigauge.gauge.group import YawTranslation, dimension, orbit_tangent
from vigauge.model.archive import save_problems
from vigauge.model.evaluation import relative_frobenius
from vigauge.model.factors import BiasPrior, LinearFactor
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.observability.diagnosis import diagnose
from vigauge.solver.factors import in_total_increments
from vigauge.solver.levenberg_marquardt import Options, solve
from vigauge.solver.normal_equations import linearise
from vigauge.solver.residuals import cost


@dataclass(frozen=True)
class Gnss:
    """The position of an antenna at p_BA in the body: its derivative by the rotation is -hat(R p_BA)."""

    keyframe: int
    measured_W: np.ndarray
    sigma: float
    p_BA: np.ndarray

    @property
    def keyframes(self) -> tuple[int, ...]:
        return (self.keyframe,)

    def at(self, state: State, reference: State) -> LinearFactor:
        i, n = self.keyframe, state.n_keyframes
        x, y, z = arm = state.R_WB[i] @ self.p_BA
        columns = np.concatenate([3 * i + np.arange(3), 3 * (n + i) + np.arange(3)])
        turn = -np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        J = np.concatenate([np.eye(3), turn], axis=1) / self.sigma
        return LinearFactor(columns, (state.p_W[i] + arm - self.measured_W) / self.sigma, J)


def with_gnss(*keyframes: int) -> Problem:
    problem = random_problem(7)
    arm = np.array([0.2, -0.1, 0.3])
    state = problem.initial
    fixes = [Gnss(k, state.p_W[k] + [0.1, -0.2, 0.05], 0.3, arm) for k in keyframes]
    return replace(problem, factors=tuple(fixes))


def dense_information(problem: Problem) -> np.ndarray:
    state = problem.initial
    J = [dense_jacobian(problem, state)]
    for factor in problem.factors:
        linear = in_total_increments(factor.at(state, state), state)
        rows = np.zeros((3, state.n_parameters))
        rows[:, linear.columns] = linear.jacobian
        J.append(rows)
    J = np.concatenate(J)
    return J.T @ J


@pytest.mark.parametrize("keyframe", [0, 2])
def test_gradient_and_hessian_hold_the_factor(keyframe: int) -> None:
    """Catches a factor left out of H, g or the cost, or the first rotation's chart forgotten."""
    problem = with_gnss(keyframe)
    state = problem.initial
    equations = linearise(problem, state)
    step = 1e-6
    numeric = [
        (cost(problem, state.retract(step * e)) - cost(problem, state.retract(-step * e))) / (2 * step)
        for e in np.eye(state.n_parameters)[: 6 * state.n_keyframes]
    ]
    assert np.allclose(equations.gradient[: len(numeric)], numeric, rtol=1e-5, atol=1e-2)
    assert relative_frobenius(equations.dense(), dense_information(problem)) < 1e-12


def test_prior_on_biases() -> None:
    """Catches another keyframe's columns, sigmas exchanged, or a bias measured that is not there."""
    problem, i = random_problem(7, biases=True), 2
    prior = BiasPrior(i, np.array([0.1, 0.2, 0.3]), np.array([-1.0, 0.0, 1.0]), 0.01, 0.2)
    with_prior, state = replace(problem, factors=(prior,)), problem.initial
    error = np.concatenate(
        [(state.gyro_bias[i] - prior.gyro) / 0.01, (state.accel_bias[i] - prior.accel) / 0.2]
    )
    assert cost(with_prior, state) - cost(problem, state) == pytest.approx(0.5 * error @ error, rel=1e-6)
    added = linearise(with_prior, state).dense() - linearise(problem, state).dense()
    n = state.n_keyframes
    at = np.concatenate([9 * n + 3 * i + np.arange(3), 12 * n + 3 * i + np.arange(3)])
    expected = np.zeros_like(added)
    expected[at, at] = np.repeat([1e4, 25.0], 3)
    assert np.allclose(added, expected, rtol=0.0, atol=1e-4)
    assert dimension(YawTranslation()) == Covariance.of(with_prior, state).U.shape[1]
    with pytest.raises(DataError, match="biases='estimated'"):
        solve(replace(random_problem(7), factors=(prior,)), FreeGauge())


@pytest.mark.parametrize(
    "wrong", [{"gyro": np.zeros(2)}, {"gyro_sigma": 0.0}, {"accel_sigma": np.nan}, {"keyframe": 0.5}]
)
def test_priors_on_biases_that_are_none(wrong: dict) -> None:
    """Catches an infinite weight, or a prior on something else."""
    right = {"keyframe": 0, "gyro": np.zeros(3), "accel": np.zeros(3), "gyro_sigma": 1.0, "accel_sigma": 1.0}
    with pytest.raises(DataError, match=next(iter(wrong))):
        BiasPrior(**(right | wrong))


def test_one_fix_leaves_the_turn_about_it() -> None:
    """Catches U that still holds directions which a factor measures, or that lost one which none does."""
    problem = with_gnss(2)
    state = problem.initial
    covariance = Covariance.of(problem, state)
    assert covariance.measured == ("yaw", "x", "y", "z")
    assert covariance.U.shape == (state.n_parameters, 1)
    H = dense_information(problem)
    assert np.linalg.norm(H @ covariance.U) < 1e-9 * np.linalg.norm(H) * np.linalg.norm(covariance.U)
    expected = np.linalg.pinv(H, rcond=1e-13, hermitian=True)
    n = 9 * state.n_keyframes
    assert relative_frobenius(covariance.motion(FreeGauge()), expected[:n, :n]) < 1e-7
    # The centroid gauge holds that combination of its four constraints that the open turn would change.
    tangent = orbit_tangent(state)
    coordinates = np.linalg.lstsq(tangent, covariance.U, rcond=None)[0]
    V = CentroidGauge().normal(state)
    V = V @ np.linalg.inv(tangent.T @ V) @ coordinates
    projected = project_covariance(expected, covariance.U, V)[:n, :n]
    assert relative_frobenius(covariance.motion(CentroidGauge()), projected) < 1e-7
    assert diagnose(problem, state).missing == 3


def test_two_fixes_leave_nothing() -> None:
    """Catches columns that are held although everything is measured."""
    problem = with_gnss(0, 3)
    state = problem.initial
    n = 9 * state.n_keyframes
    expected = np.linalg.inv(dense_information(problem))[:n, :n]
    covariance = Covariance.of(problem, state)
    assert covariance.U.shape[1] == 0
    for gauge in (FreeGauge(), CentroidGauge(), KeyframeGauge(2)):
        assert relative_frobenius(covariance.motion(gauge), expected) < 1e-8
    assert (
        relative_frobenius(covariance.joint(FreeGauge(), range(state.n_keyframes)).trace(), expected.trace())
        < 1e-8
    )


def test_the_solver_goes_to_the_fixes() -> None:
    """Catches a solver that ignores the factors: the estimate must end where they say."""
    problem = with_gnss(0, 1, 2, 3)
    free = solve(replace(problem, factors=()), FreeGauge(), Options(maximum_iterations=200))
    pulled = solve(problem.with_initial(free.state), FreeGauge(), Options(maximum_iterations=200))
    misfit = [
        np.linalg.norm(f.at(run.state, problem.initial).residual)
        for run in (free, pulled)
        for f in problem.factors
    ]
    assert sum(misfit[4:]) < sum(misfit[:4])
    assert pulled.cost < cost(problem, free.state)


def test_the_prior_is_a_factor_like_others() -> None:
    """Catches a prior whose object and whose residual differ."""
    problem = random_problem(7)
    state = problem.initial
    as_factor = replace(problem, factors=(PriorGauge(1e3).factor,))
    prior = PriorGauge(1e3).prior(state, problem.initial)
    expected = linearise(problem, state).with_factor(prior).dense()
    assert relative_frobenius(linearise(as_factor, state).dense(), expected) < 1e-14
    n = 9 * state.n_keyframes
    ours = Covariance.of(problem, state).motion(PriorGauge(1e3))
    assert relative_frobenius(Covariance.of(as_factor, state).motion(FreeGauge()), ours) < 1e-7
    assert relative_frobenius(ours, np.linalg.inv(expected)[:n, :n]) < 1e-7


def test_prior_on_measured_directions_is_refused() -> None:
    """Catches a prior's covariance by a formula that holds only where nothing else is measured."""
    problem = with_gnss(1)
    with pytest.raises(DataError, match="motion factor"):
        Covariance.of(problem, problem.initial).motion(PriorGauge(1e3))


def test_held_rows_are_zero() -> None:
    """Catches rounding errors in rows that a gauge holds."""
    problem = random_problem(7)
    state = problem.initial
    covariance = Covariance.of(problem, state)
    for gauge, rows in ((FixedGauge(), FixedGauge().held(state)), (KeyframeGauge(2), [6, 7, 8])):
        assert not covariance.motion(gauge)[rows].any()
    assert np.abs(orbit_tangent(state)).max() > 0


@pytest.mark.parametrize(
    "linear",
    [
        LinearFactor(np.array([0, 0]), np.ones(1), np.ones((1, 2))),
        LinearFactor(np.array([0, 9999]), np.ones(1), np.ones((1, 2))),
        LinearFactor(np.array([0]), np.ones(2), np.ones((1, 1))),
        LinearFactor(np.array([0]), np.array([np.nan]), np.ones((1, 1))),
    ],
)
def test_malformed_factors_are_refused(linear: LinearFactor) -> None:
    """Catches a factor that writes outside of the system, or NaN that spreads."""

    class Broken:
        keyframes = (0,)

        def at(self, state: State, reference: State) -> LinearFactor:
            return linear

    problem = replace(random_problem(7), factors=(Broken(),))
    with pytest.raises(DataError, match="motion factor 0"):
        linearise(problem, problem.initial)


def test_factors_are_not_written_to_an_archive(tmp_path) -> None:
    """Catches a problem that loses its factors on the way through a file."""
    with pytest.raises(DataError, match="motion factors"):
        save_problems(tmp_path / "p.npz", [with_gnss(1)])
