"""Problems with biases in GTSAM, on its own preintegration: same minimum, same covariance."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from support.simulated import TIGHT, biased_estimate, biased_trial
from vigauge.covariance.covariance import Covariance
from vigauge.gauge.gauges import FreeGauge, PriorGauge
from vigauge.geometry import so3
from vigauge.model.evaluation import align_first_pose, relative_frobenius
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.levenberg_marquardt import solve
from vigauge.solver.residuals import cost

gtsam = pytest.importorskip("gtsam")
from benchmarks import peer_gtsam_biases as peer  # noqa: E402

pytestmark = pytest.mark.oracle
SHAPES = ("sine", "arc", "rec")


@cache
def case(shape: str) -> tuple[Problem, list]:
    """The problem with GTSAM's own increments, at biases near those of our minimum."""
    trial, near = biased_trial(0, shape), biased_estimate(0, shape)
    biases = near.gyro_bias.mean(axis=0), near.accel_bias.mean(axis=0)
    pims = peer.preintegrated(trial.samples, trial.keyframe_ns, trial.noise, *biases, trial.problem.gravity)
    initial = trial.problem.initial.with_biases(*biases)
    return replace(trial.problem, initial=initial, inertial=peer.factors_of(pims)), pims


@pytest.mark.parametrize("shape", SHAPES)
def test_same_minimum(shape, record_property):
    """Catches a bias that is corrected with another sign, frame or order than GTSAM's, or a walk between
    other keyframes: same cost to 1e-6, same states up to the gauge."""
    problem, pims = case(shape)
    ours = solve(problem, FreeGauge(), TIGHT)
    graph = peer.graph_of(problem, pims, None)
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(1e-15)
    parameters.setAbsoluteErrorTol(1e-13)
    parameters.setMaxIterations(100)
    start = peer.values_of(problem.initial)
    values = gtsam.LevenbergMarquardtOptimizer(graph, start, parameters).optimize()
    theirs = peer.state_of(values, problem.initial)
    record_property("relative_cost", abs(graph.error(values) / ours.cost - 1.0))
    assert graph.error(values) == pytest.approx(ours.cost, rel=1e-6)
    assert cost(problem, theirs) == pytest.approx(ours.cost, rel=1e-6)
    theirs = align_first_pose(theirs, ours.state)
    assert np.abs(theirs.p_W - ours.state.p_W).max() < 1e-5
    assert np.abs(so3.log(theirs.R_WB @ ours.state.R_WB.swapaxes(1, 2))).max() < 1e-5
    assert np.abs(theirs.gyro_bias - ours.state.gyro_bias).max() < 1e-6
    assert np.abs(theirs.accel_bias - ours.state.accel_bias).max() < 1e-5


def predicted(state: State, problem: Problem, pims: list) -> State:
    """A state without inertial errors, by GTSAM's predictions from the first keyframe of a state: H there is
    no matter of the frame of the errors."""
    here = gtsam.NavState(gtsam.Pose3(gtsam.Rot3(state.R_WB[0]), state.p_W[0]), state.v_W[0])
    chain = [here]
    for pim in pims:
        chain.append(pim.predict(chain[-1], pim.biasHat()))
    n = state.n_keyframes
    return State.start(
        np.array([x.position() for x in chain]),
        np.array([x.attitude().matrix() for x in chain]),
        np.array([x.velocity() for x in chain]),
        state.X_W,
        np.tile(problem.inertial.gyro_bias[0], (n, 1)),
        np.tile(problem.inertial.accel_bias[0], (n, 1)),
    )


@pytest.mark.parametrize("shape", SHAPES)
def test_covariance_is_that_of_marginals(shape, record_property):
    """Catches another chart, unit or order of the 15 parameters, with the gauge prior of (11) in both."""
    problem, pims = case(shape)
    state = predicted(biased_estimate(0, shape), problem, pims)
    problem = problem.with_initial(state)
    weight = 1e3
    graph = peer.graph_of(problem, pims, weight)
    joint = gtsam.Marginals(graph, peer.values_of(state)).jointMarginalCovariance(peer.motion_keys(10))
    theirs = peer.in_our_parameters(joint.fullMatrix(), state)
    ours = Covariance.of(problem, state).motion(PriorGauge(weight))
    record_property("relative_frobenius", relative_frobenius(ours, theirs))
    assert relative_frobenius(ours, theirs) < 1e-8
