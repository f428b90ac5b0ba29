"""The trust-region loop: where it ends in each gauge, how it ends, and how it counts."""

from dataclasses import replace

import numpy as np
import pytest

from support.random_problem import random_problem
from support.simulated import TIGHT, biased_trial, estimate, scene, trial
from vigauge.covariance.covariance import motion_covariance
from vigauge.errors import DataError, SolverError
from vigauge.gauge.gauges import FixedGauge, FreeGauge, PriorGauge
from vigauge.geometry import so3
from vigauge.model.evaluation import align_first_pose, trajectory_errors
from vigauge.model.problem import Problem
from vigauge.solver import levenberg_marquardt as lm
from vigauge.solver.levenberg_marquardt import CONVERGED, Options, Status, _TrustRegion, solve
from vigauge.solver.normal_equations import NormalEquations, linearise
from vigauge.solver.residuals import cost, mean_reprojection_px

CONFIGURATIONS = [(shape, points) for shape in ("sine", "arc", "rec") for points in ("plane", "random")]
GAUGES = [FixedGauge(), PriorGauge(1e5), FreeGauge()]
by_name = {"argvalues": GAUGES, "ids": lambda gauge: gauge.name}


# Where it ends


@pytest.mark.parametrize(("shape", "points"), CONFIGURATIONS)
def test_all_gauges_end_on_the_same_orbit(shape, points):
    """Catches a gauge that changes the estimate: equal costs, equal states after 4-DoF alignment."""
    problem = trial(0, shape, points)
    free = solve(problem, FreeGauge(), TIGHT)
    for gauge in (FixedGauge(), PriorGauge(1e5), PriorGauge(1e2)):
        solution = solve(problem, gauge, TIGHT)
        assert solution.converged, solution.status
        assert cost(problem, solution.state) == pytest.approx(cost(problem, free.state), rel=1e-9)
        aligned = align_first_pose(solution.state, free.state)
        assert np.abs(aligned.p_W - free.state.p_W).max() < 1e-6
        assert np.abs(so3.log(aligned.R_WB @ free.state.R_WB.swapaxes(1, 2))).max() < 1e-6
        assert np.abs(aligned.v_W - free.state.v_W).max() < 1e-6
        assert np.abs(aligned.X_W - free.state.X_W).max() < 1e-5


@pytest.mark.parametrize("biases", [False, True])
@pytest.mark.parametrize("gauge", **by_name)
def test_the_end_is_a_minimum(gauge, biases):
    """Catches a loop that stops anywhere: the gradient in the gauge's own columns vanishes."""
    problem = biased_trial(1, "arc", "plane").problem if biases else trial(1, "arc", "plane")
    solution = solve(problem, gauge, TIGHT)
    equations = linearise(problem, solution.state)
    free = np.setdiff1d(np.arange(len(equations.gradient)), gauge.held(problem.initial))
    scaled = equations.gradient / np.sqrt(equations.diagonal())
    start = linearise(problem, problem.initial).gradient / np.sqrt(equations.diagonal())
    assert np.abs(scaled[free]).max() < 1e-6 * np.abs(start).max()


def test_noise_free_measurements_give_the_truth():
    """Catches a bias of the estimator itself: exact pixels and dense inertial samples, exact poses."""
    world = scene("arc", "random", sigma_px=1e-3, gyro_density=1e-7, accel_density=1e-6)
    problem = trial(0, "arc", "random", sigma_px=1e-3, gyro_density=1e-7, accel_density=1e-6)
    solution = solve(problem, FreeGauge(), TIGHT)
    errors = trajectory_errors(solution.state, world.truth)
    assert errors.p_rmse_m < 1e-4
    assert errors.phi_rmse_rad < 1e-4
    assert errors.v_rmse_mps < 1e-3


@pytest.mark.parametrize("shape", ["sine", "rec"])
def test_biases_are_found(shape):
    """Catches biases that stay where they began, at zero, or take the wrong sign: within five sigma of the
    truth, of which the true ones are many away."""
    biased = biased_trial(2, shape)
    state = solve(biased.problem, FreeGauge()).state
    n = state.n_keyframes
    sigma = np.sqrt(np.diagonal(motion_covariance(biased.problem, state, FreeGauge()))[9 * n :]).reshape(
        2, n, 3
    )
    for name, known_to in zip(("gyro_bias", "accel_bias"), sigma, strict=True):
        error = (getattr(state, name) - getattr(biased.truth, name)) / known_to
        assert np.abs(error).max() < 5.0
    assert np.abs(biased.truth.gyro_bias / sigma[0]).max() > 10.0


@pytest.mark.parametrize(("shape", "points"), CONFIGURATIONS[:2])
def test_fixation_does_not_move_what_it_holds(shape, points):
    """Catches a held column that drifts by rounding: p_0 and the yaw of (9) stay, in every iteration."""
    problem = trial(0, shape, points)
    solution = solve(problem, FixedGauge(), keep_states=True)
    assert len(solution.states) == solution.iterations > 2
    for state in solution.states:
        assert np.array_equal(state.p_W[0], problem.initial.p_W[0])
        assert state.dphi_0[2] == 0.0
        turned = so3.log(state.R_WB[0] @ problem.initial.R_WB[0].T)
        assert abs(turned[2]) < 1e-15
    assert np.linalg.norm(solution.state.dphi_0) > 1e-2  # roll and pitch did move
    assert all(row.prior_position_m == 0.0 and row.prior_yaw_rad == 0.0 for row in solution.trace)


def test_prior_holds_softly_and_free_does_not():
    """Catches a prior that does nothing, or the wrong weight: the first pose leaves its place by less
    the larger the weight, and in the free gauge by centimetres."""
    problem = trial()
    moved = [
        np.linalg.norm(solve(problem, gauge).state.p_W[0] - problem.initial.p_W[0])
        for gauge in (FreeGauge(), PriorGauge(1e5), PriorGauge(1e8))
    ]
    assert moved[0] > 1e-3
    assert moved[1] < 1e-4
    assert moved[2] < 1e-7


@pytest.mark.parametrize("gauge", **by_name)
def test_cost_falls_in_every_accepted_step(gauge):
    """Catches a step taken uphill, and a trace whose rows belong to another state."""
    problem = trial(2, "rec", "plane")
    solution = solve(problem, gauge, keep_states=True)
    costs = [row.cost for row in solution.trace]
    assert all(after < before for before, after in zip(costs, costs[1:], strict=False))
    for row, state in zip(solution.trace, solution.states, strict=True):
        assert row.mean_reprojection_px == pytest.approx(mean_reprojection_px(problem, state), rel=1e-12)
        prior = gauge.prior(state, problem.initial)
        extra = 0.0 if prior is None else 0.5 * prior.residual @ prior.residual
        assert row.cost == pytest.approx(cost(problem, state) + extra, rel=1e-12)
        assert row.prior_position_m == pytest.approx(
            np.linalg.norm(state.p_W[0] - problem.initial.p_W[0]), abs=1e-16
        )
        assert row.prior_yaw_rad == abs(state.dphi_0[2])
    assert solution.cost == costs[-1]
    assert solution.state is solution.states[-1]


def test_same_problem_same_bits():
    """Catches hidden state between runs: nothing may depend on what was solved before."""
    a, _, b = solve(trial(), FreeGauge()), solve(trial(1), FixedGauge()), solve(trial(), FreeGauge())
    assert a.trace == b.trace
    assert np.array_equal(a.state.X_W, b.state.X_W)


def test_the_start_is_left_alone():
    """Catches an estimate written over the problem's initial state."""
    problem = random_problem(1, biases=True)
    before = {name: array.copy() for name, array in vars(problem.initial).items()}
    solve(problem, FreeGauge(), Options(maximum_iterations=3))
    assert all(np.array_equal(before[name], array) for name, array in vars(problem.initial).items())


def test_another_start_keeps_the_reference():
    """Catches a prior about the start, or a start of another problem that is let in."""
    problem, gauge = trial(), PriorGauge(1e5)
    whole = solve(problem, gauge, TIGHT)
    again = solve(problem, gauge, TIGHT, start=whole.state.transformed(0.1, np.ones(3)))
    assert again.cost == pytest.approx(whole.cost, rel=1e-9)
    assert np.abs(again.state.p_W[0] - problem.initial.p_W[0]).max() < 1e-6
    with pytest.raises(DataError, match="keyframes"):
        solve(problem, gauge, start=random_problem(1).initial)


# How it ends


def statuses(options: Options) -> tuple[Status, int]:
    solution = solve(trial(), FreeGauge(), options)
    return solution.status, solution.iterations


def test_defaults_are_those_of_ceres():
    """Catches a changed default: the paper's iteration counts rest on them."""
    o = Options()
    assert (o.initial_radius, o.maximum_radius, o.minimum_radius) == (1e4, 1e16, 1e-32)
    assert (o.minimum_diagonal, o.maximum_diagonal) == (1e-6, 1e32)
    assert (o.function_tolerance, o.gradient_tolerance, o.parameter_tolerance) == (1e-6, 1e-10, 1e-8)
    assert (o.minimum_decrease, o.maximum_iterations, o.maximum_invalid_steps) == (1e-3, 50, 5)


def test_counting_includes_the_start_but_not_the_last_step():
    """Catches an iteration count that is one off from what Ceres reports."""
    assert statuses(Options(maximum_iterations=0)) == (Status.ITERATION_LIMIT, 1)
    assert statuses(Options(maximum_iterations=2)) == (Status.ITERATION_LIMIT, 3)
    # The first step already meets a tolerance of 100 %: it is tried, not taken, not counted.
    assert statuses(Options(function_tolerance=1.0)) == (Status.FUNCTION_TOLERANCE, 1)
    stopped = solve(trial(), FreeGauge(), Options(function_tolerance=1.0))
    assert np.array_equal(stopped.state.p_W, trial().initial.p_W)


def test_parameter_tolerance_waits_for_a_first_success():
    """Catches a run that ends before it begins: Ceres tests the step only after one was accepted."""
    assert statuses(Options(parameter_tolerance=1e9)) == (Status.PARAMETER_TOLERANCE, 2)


def test_gradient_tolerance_is_tested_at_the_start():
    """Catches a needless step from a start that is a minimum; held columns do not count."""
    assert statuses(Options(gradient_tolerance=1e300)) == (Status.GRADIENT_TOLERANCE, 1)
    # Beside its minimum, moved at the first position only, the held columns have the largest gradient.
    start = estimate()
    p_W = start.p_W.copy()
    p_W[0] += 1e-3
    problem = trial().with_initial(replace(start, p_W=p_W))
    gradient = np.abs(linearise(problem, problem.initial).gradient)
    held = FixedGauge().held(problem.initial)
    others = float(np.delete(gradient, held).max())
    assert others < gradient[held].max()
    options = Options(gradient_tolerance=0.5 * (others + float(gradient[held].max())))
    assert solve(problem, FixedGauge(), options).iterations == 1
    assert solve(problem, FreeGauge(), options).iterations > 1


def test_iteration_limit_comes_before_the_other_tests():
    """Catches convergence reported for a run that was cut off; the limit is no convergence."""
    options = Options(maximum_iterations=0, gradient_tolerance=1e300)
    assert statuses(options) == (Status.ITERATION_LIMIT, 1)
    assert Status.ITERATION_LIMIT not in CONVERGED
    assert not solve(trial(), FreeGauge(), options).converged


def test_trust_region_may_collapse():
    """Catches an endless loop of ever smaller steps."""
    status, iterations = statuses(Options(initial_radius=1e-33))
    assert (status, iterations) == (Status.RADIUS_COLLAPSED, 1)
    assert Status.RADIUS_COLLAPSED not in CONVERGED


def test_radius_follows_nielsen():
    """Catches another update: thirds at best, unchanged at quality 1/2, then 2, 4, 8 on failures."""
    region = _TrustRegion(Options())
    region.accept(1.0)
    assert region.radius == pytest.approx(3e4)
    region.accept(0.5)
    assert region.radius == pytest.approx(3e4)
    region.accept(0.1)
    assert region.radius == pytest.approx(3e4 / (1.0 + 0.8**3))
    before = region.radius
    for divisor in (2.0, 8.0, 64.0):
        region.reject()
        assert region.radius == pytest.approx(before / divisor)
    region.accept(0.5)
    region.reject()
    assert region.radius == pytest.approx(before / 128.0)
    region.radius = 1e16
    region.accept(1.0)
    assert region.radius == 1e16


def test_invalid_steps_end_the_run(monkeypatch):
    """Catches an endless loop, or a traceback, where the system cannot be factorised: five in a row
    end the run, with the radius cut after each of the first four."""

    def singular(self, damping=None, workers=None):
        raise SolverError("singular")

    monkeypatch.setattr(NormalEquations, "eliminate", singular)
    solution = solve(trial(), FreeGauge())
    assert solution.status is Status.INVALID_STEPS
    assert not solution.converged
    assert [row.accepted for row in solution.trace] == [True, False, False, False, False]
    assert [row.radius for row in solution.trace] == [1e4, 5e3, 1.25e3, 1.5625e2, 9.765625]
    assert np.array_equal(solution.state.p_W, trial().initial.p_W)


def test_one_invalid_step_is_survived(monkeypatch):
    """Catches a count of invalid steps that is not reset by a valid one."""
    calls = []
    eliminate = NormalEquations.eliminate

    def sometimes(self, damping=None, workers=None):
        calls.append(1)
        if len(calls) % 2:
            raise SolverError("singular")
        return eliminate(self, damping, workers)

    monkeypatch.setattr(NormalEquations, "eliminate", sometimes)
    solution = solve(trial(), FreeGauge(), Options(maximum_invalid_steps=2))
    assert solution.converged


def at_the_camera_centre(problem: Problem) -> Problem:
    """The first landmark at zero depth: its projection is infinite."""
    X_W = problem.initial.X_W.copy()
    X_W[0] = problem.initial.p_W[problem.obs_keyframe[problem.obs_landmark == 0][0]]
    return problem.with_initial(replace(problem.initial, X_W=X_W))


@pytest.mark.parametrize("gauge", **by_name)
def test_a_start_without_cost_is_reported(gauge):
    """Catches a traceback or a warning instead of a status: nothing is raised, nothing is tried."""
    solution = solve(at_the_camera_centre(trial()), gauge)
    assert solution.status is Status.NON_FINITE
    assert not solution.converged
    assert solution.iterations == 1
    assert not np.isfinite(solution.cost)


def test_a_step_without_cost_is_rejected(monkeypatch):
    """Catches a NaN that passes for progress: such a step is shortened like any bad one."""
    evaluate, calls = lm.evaluate, []

    def broken_once(problem, state):
        calls.append(1)
        found = evaluate(problem, state)
        return found._replace(cost=np.nan) if len(calls) == 2 else found

    monkeypatch.setattr(lm, "evaluate", broken_once)
    solution = solve(trial(), FreeGauge())
    assert [row.accepted for row in solution.trace[:3]] == [True, False, True]
    assert solution.trace[1].radius == 5e3
    assert solution.converged


# Time


def test_the_clock_is_the_callers():
    """Catches a solver that reads the clock itself: without one every time is zero."""
    assert solve(trial(), FreeGauge()).seconds == 0.0
    ticks = iter(range(1000))
    solution = solve(trial(), FreeGauge(), clock=lambda: float(next(ticks)))
    seconds = [row.seconds for row in solution.trace]
    assert seconds == sorted(seconds)
    assert seconds[0] >= 1.0
    assert solution.seconds > seconds[-1]
    assert solve(trial(), FreeGauge()).states == ()


def test_threads_change_no_number():
    """Catches sums whose order depends on the number of threads: the same bytes from one and two."""
    problem = random_problem(4, n_keyframes=40, n_landmarks=20_000, window=4)
    assert len(problem.structure.pieces) > 2
    one, two = (solve(problem, FreeGauge(), Options(maximum_iterations=2, threads=n)) for n in (1, 2))
    assert [row.cost for row in one.trace] == [row.cost for row in two.trace]
    assert np.array_equal(one.state.X_W, two.state.X_W)
