"""The same problems in GTSAM: minimum and covariance by other residuals, on another manifold.

Projection factors are GTSAM's own, and as the benchmarks have them. The inertial factor is written here
in GTSAM's terms, with increments on the right, in the body frame, where ours are on the left, in the world.
"""

from functools import cache

import numpy as np
import pytest

from support.random_problem import random_problem
from support.simulated import TIGHT, trial
from vigauge.covariance.covariance import motion_covariance
from vigauge.gauge.gauges import FixedGauge, FreeGauge, PriorGauge
from vigauge.gauge.group import orbit_tangent
from vigauge.geometry import so3
from vigauge.model.evaluation import align_first_pose, relative_frobenius
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.levenberg_marquardt import solve
from vigauge.solver.residuals import cost

gtsam = pytest.importorskip("gtsam")
from gtsam.symbol_shorthand import V, X  # noqa: E402

from benchmarks.peer_gtsam import (  # noqa: E402
    first_pose_factor,
    in_our_parameters,
    motion_keys,
    observations_of,
    state_of,
    values_of,
)

pytestmark = pytest.mark.oracle

CONFIGURATIONS = [(shape, points) for shape in ("sine", "arc", "rec") for points in ("plane", "random")]


def inertial_factor(problem: Problem, row: int):
    """GTSAM factor between poses and velocities of two keyframes, from one row of the problem."""
    f = problem.inertial
    i, j, dt = int(f.first[row]), int(f.second[row]), float(f.dt[row])
    g_W = np.array([0.0, 0.0, -problem.gravity])
    dR = gtsam.Rot3(f.dR[row])

    def error(this, values, jacobians):
        T_i, T_j = values.atPose3(this.keys()[0]), values.atPose3(this.keys()[2])
        v_i, v_j = values.atVector(this.keys()[1]), values.atVector(this.keys()[3])
        R_i, R_j = T_i.rotation(), T_j.rotation()
        shift = R_i.unrotate(T_j.translation() - T_i.translation() - v_i * dt - 0.5 * g_W * dt * dt)
        change = R_i.unrotate(v_j - v_i - g_W * dt)
        turn = gtsam.Rot3.Logmap(dR.inverse().compose(R_i.inverse()).compose(R_j))
        if jacobians is not None:
            R_iT, R_ij = R_i.matrix().T, R_i.matrix().T @ R_j.matrix()
            inverse = gtsam.Rot3.LogmapDerivative(turn)
            zero, eye = np.zeros((3, 3)), np.eye(3)
            jacobians[0] = np.asfortranarray(
                np.block(
                    [[gtsam.Rot3.Hat(shift), -eye], [-inverse @ R_ij.T, zero], [gtsam.Rot3.Hat(change), zero]]
                )
            )
            jacobians[1] = np.asfortranarray(np.vstack([-R_iT * dt, zero, -R_iT]))
            jacobians[2] = np.asfortranarray(np.block([[zero, R_ij], [inverse, zero], [zero, zero]]))
            jacobians[3] = np.asfortranarray(np.vstack([zero, zero, R_iT]))
        return np.concatenate([shift - f.dp[row], turn, change - f.dv[row]])

    noise = gtsam.noiseModel.Gaussian.Covariance(f.covariance[row])
    return gtsam.CustomFactor(noise, [X(i), V(i), X(j), V(j)], error)


def graph_of(problem: Problem):
    """All measurements of a problem, without any gauge."""
    graph = observations_of(problem)
    for row in range(len(problem.inertial.dt)):
        graph.add(inertial_factor(problem, row))
    return graph


def with_gauge(problem: Problem, gauge: str, weight: float = 1e5):
    graph = graph_of(problem)
    if gauge == "fix":
        graph.add(first_pose_factor(problem.initial, gtsam.noiseModel.Constrained.All(4)))
    elif gauge == "prior":
        graph.add(first_pose_factor(problem.initial, gtsam.noiseModel.Isotropic.Precision(4, weight)))
    return graph


@cache
def minimum(shape: str, points: str, gauge: str):
    """GTSAM's minimum: graph, values, our State of them."""
    problem = trial(0, shape, points)
    graph = with_gauge(problem, gauge)
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(1e-15)
    parameters.setAbsoluteErrorTol(1e-13)
    parameters.setMaxIterations(100)
    if gauge == "fix":
        parameters.setLinearSolverType("MULTIFRONTAL_QR")  # Cholesky cannot take hard constraints
    values = gtsam.LevenbergMarquardtOptimizer(graph, values_of(problem.initial), parameters).optimize()
    return graph, values, state_of(values, problem.initial)


@pytest.mark.parametrize("seed", range(3))
def test_same_cost_away_from_the_minimum(seed):
    """Catches an error common to both of our code paths: residuals of two cameras with extrinsics,
    and of inertial factors, by GTSAM's own geometry."""
    problem = random_problem(seed)
    ours = cost(problem, problem.initial)
    assert graph_of(problem).error(values_of(problem.initial)) == pytest.approx(ours, rel=1e-12)


def test_factors_written_here_are_differentiated_correctly():
    """Catches an oracle with wrong Jacobians: against GTSAM's numerical ones, by the gradient."""
    problem = random_problem(2)
    values = values_of(problem.initial)
    factors = [inertial_factor(problem, row) for row in range(2)]
    factors.append(first_pose_factor(problem.initial, gtsam.noiseModel.Unit.Create(4)))
    for factor in factors:
        linear = factor.linearize(values)
        A, b = linear.jacobian()
        column = 0
        for key in factor.keys():  # noqa: SIM118, no mapping
            for axis in range(6 if gtsam.Symbol(key).chr() == ord("x") else 3):
                errors = []
                for step in (1e-5, -1e-5):
                    delta = gtsam.VectorValues()
                    size = 6 if gtsam.Symbol(key).chr() == ord("x") else 3
                    delta.insert(key, step * np.eye(size)[axis])
                    moved = factor.linearize(values.retract(delta))
                    errors.append(-moved.jacobian()[1])
                numeric = (errors[0] - errors[1]) / 2e-5
                assert np.allclose(A[:, column], numeric, rtol=1e-5, atol=1e-5 * np.abs(A).max())
                column += 1
        assert len(b) == A.shape[0]


@pytest.mark.parametrize("gauge", ["fix", "prior", "free"])
@pytest.mark.parametrize(("shape", "points"), CONFIGURATIONS)
def test_same_minimum(shape, points, gauge, record_property):
    """Catches a minimum that is only ours: same cost to 1e-6 relative, same states up to the gauge."""
    problem = trial(0, shape, points)
    ours = solve(problem, {"fix": FixedGauge(), "prior": PriorGauge(1e5), "free": FreeGauge()}[gauge], TIGHT)
    graph, values, theirs = minimum(shape, points, gauge)
    record_property("relative_cost", abs(graph.error(values) / ours.cost - 1.0))
    assert graph.error(values) == pytest.approx(ours.cost, rel=1e-6)
    assert cost(problem, theirs) == pytest.approx(ours.cost, rel=1e-6)
    if gauge == "free":
        theirs = align_first_pose(theirs, ours.state)
    assert np.abs(theirs.p_W - ours.state.p_W).max() < 1e-5
    assert np.abs(so3.log(theirs.R_WB @ ours.state.R_WB.swapaxes(1, 2))).max() < 1e-5
    assert np.abs(theirs.v_W - ours.state.v_W).max() < 1e-5
    if gauge == "fix":
        assert np.abs(theirs.p_W[0] - problem.initial.p_W[0]).max() < 1e-9
        assert abs(theirs.dphi_0[2]) < 1e-9


def marginal_covariance(graph, values, state: State) -> np.ndarray:
    """(9N, 9N) covariance by gtsam.Marginals, taken to our parameters and our order."""
    joint = gtsam.Marginals(graph, values).jointMarginalCovariance(motion_keys(state.n_keyframes))
    return in_our_parameters(joint, state)


@pytest.mark.parametrize(("shape", "points"), CONFIGURATIONS)
def test_fixed_covariance_is_that_of_marginals(shape, points, record_property):
    """Catches a covariance in other units, frames or order: GTSAM's marginals under a stiff prior.

    The prior leaves the variance 1/w along the orbit, so theirs is ours plus T T^T / w, with T
    the orbit's tangent in units of the gauge: for w = 1e9 that is 1e-5 of the whole or less.
    """
    weight = 1e9
    problem = trial(0, shape, points)
    _, values, state = minimum(shape, points, "prior")
    theirs = marginal_covariance(with_gauge(problem, "prior", weight), values, state)
    fixed = motion_covariance(problem, state, FixedGauge())
    U, V_normal = orbit_tangent(state), FixedGauge().normal(state)
    T = (U @ np.linalg.inv(V_normal.T @ U))[: len(fixed)]
    slack = np.linalg.norm(T @ T.T) / weight / np.linalg.norm(fixed)
    record_property("to_fixed", relative_frobenius(theirs, fixed))
    record_property("to_predicted", relative_frobenius(theirs, fixed + T @ T.T / weight))
    assert slack < 1e-4
    assert relative_frobenius(theirs, fixed) < 1.01 * slack + 1e-8
    assert relative_frobenius(theirs, fixed + T @ T.T / weight) < 1e-7
    assert relative_frobenius(theirs, motion_covariance(problem, state, PriorGauge(weight))) < 1e-7


def test_marginals_at_the_headline_weight():
    """Catches a prior that is not (11): at w = 1e5 the covariances of prior and Marginals agree, and
    both differ from the fixed one."""
    problem = trial(0, "arc", "plane")
    graph, values, state = minimum("arc", "plane", "prior")
    theirs = marginal_covariance(graph, values, state)
    ours = motion_covariance(problem, state, PriorGauge(1e5))
    assert relative_frobenius(theirs, ours) < 1e-8
    assert relative_frobenius(theirs, motion_covariance(problem, state, FixedGauge())) > 1e-4
