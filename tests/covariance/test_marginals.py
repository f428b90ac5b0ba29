"""Blocks of a covariance against the whole matrix, dense and banded."""

from dataclasses import replace

import numpy as np
import pytest

from support.dense import dense_jacobian
from support.gauged import covariance_of
from support.random_problem import random_problem
from support.simulated import estimate, trial
from vigauge.covariance.covariance import (
    Covariance,
    keyframe_covariances,
    landmark_covariances,
    motion_covariance,
)
from vigauge.covariance.held_inverse import HeldInverse
from vigauge.covariance.projection import project_covariance
from vigauge.errors import DataError
from vigauge.gauge.gauges import CentroidGauge, FixedGauge, FreeGauge, KeyframeGauge, PriorGauge
from vigauge.gauge.group import orbit_tangent
from vigauge.gauge.normals import normal_from
from vigauge.geometry import so3
from vigauge.model.evaluation import relative_frobenius
from vigauge.model.problem import Problem
from vigauge.solver.normal_equations import linearise

GAUGES = [FreeGauge(), FixedGauge(), PriorGauge(1e3), CentroidGauge(), KeyframeGauge(index=4)]


def long_flight() -> Problem:
    """Banded: thirty keyframes, tracks over four of them."""
    problem = random_problem(3, n_keyframes=30, n_landmarks=200, window=4)
    f = problem.inertial
    names = ("first", "second", "dt", "dp", "dR", "dv", "covariance")
    return replace(problem, inertial=replace(f, **{name: getattr(f, name)[:-1] for name in names}))


def cases():
    flight = long_flight()
    assert flight.structure.layout.banded
    return [(trial(), estimate()), (flight, flight.initial)]


@pytest.mark.parametrize("gauge", GAUGES, ids=lambda gauge: gauge.name)
@pytest.mark.parametrize("case", range(2))
def test_keyframe_blocks_are_those_of_the_whole(case, gauge):
    """Catches a block of another keyframe, an entry outside the band, a projection that leaves out a term."""
    problem, state = cases()[case]
    whole = motion_covariance(problem, state, gauge)
    columns = problem.structure.columns
    blocks = keyframe_covariances(problem, state, gauge)
    scale = np.abs(whole).max()
    for keyframe, block in enumerate(blocks):
        expected = whole[np.ix_(columns[keyframe], columns[keyframe])]
        assert np.abs(block - expected).max() < 1e-9 * scale
    assert np.array_equal(keyframe_covariances(problem, state, gauge, [7, 2]), blocks[[7, 2]])
    joint = Covariance.of(problem, state).joint(gauge, [7, 2])
    rows = columns[[7, 2]].ravel()
    assert np.abs(joint - whole[np.ix_(rows, rows)]).max() < 1e-9 * scale


@pytest.mark.parametrize("gauge", GAUGES, ids=lambda gauge: gauge.name)
@pytest.mark.parametrize("case", range(2))
def test_landmark_blocks_are_those_of_the_dense_covariance(case, gauge):
    """Catches landmarks without the motion's share, or without their rows in the gauge's projection."""
    problem, state = cases()[case]
    J = dense_jacobian(problem, state)
    keep = np.setdiff1d(np.arange(J.shape[1]), FixedGauge().held(state))
    G = np.zeros((J.shape[1],) * 2)
    G[np.ix_(keep, keep)] = np.linalg.inv(J[:, keep].T @ J[:, keep])
    U, prior = orbit_tangent(state), gauge.prior(state, problem.initial)
    whole = project_covariance(G, U, gauge.normal(state))
    if prior is not None:
        V = np.zeros_like(U)
        V[prior.columns] = prior.jacobian.T
        along = U @ np.linalg.inv(V.T @ U)
        whole = whole + along @ along.T
    n = 9 * state.n_keyframes
    blocks = landmark_covariances(problem, state, gauge)
    scale = np.abs(whole[n:, n:]).max()
    for landmark, block in enumerate(blocks):
        rows = n + 3 * landmark + np.arange(3)
        assert np.abs(block - whole[np.ix_(rows, rows)]).max() < 1e-7 * scale


def test_banded_inverse_is_the_dense_one():
    """Catches a wrong recurrence: every entry in the band against the inverse; and products with G."""
    problem = long_flight()
    state = problem.initial
    reduced = linearise(problem, state).eliminate()
    held = FixedGauge().held(state)
    inverse = HeldInverse.of(reduced, held)
    keep = np.setdiff1d(np.arange(len(reduced.matrix)), held)
    expected = np.zeros_like(reduced.matrix)
    expected[np.ix_(keep, keep)] = np.linalg.inv(reduced.matrix[np.ix_(keep, keep)])
    assert relative_frobenius(inverse.dense(), expected) < 1e-8
    near = problem.structure.columns[10:13].ravel()
    assert relative_frobenius(inverse.blocks(near[None])[0], expected[np.ix_(near, near)]) < 1e-8
    B = np.random.default_rng(0).normal(size=(len(expected), 3))
    assert relative_frobenius(inverse.times(B), expected @ B) < 1e-8
    assert not np.any(inverse.times(B)[held])


def test_same_from_equations_at_hand():
    """Catches a covariance that depends on how often the inverse was asked for: factors are not consumed."""
    problem, state = cases()[0]
    inverse = HeldInverse.of(linearise(problem, state).eliminate(), FixedGauge().held(state))
    first = inverse.dense()
    assert np.array_equal(first, inverse.dense())
    fixed = covariance_of(linearise(problem, state), state, FixedGauge(), problem.initial)
    assert np.array_equal(first, fixed)


def test_wrong_numbers_are_named():
    """Catches a negative index that silently counts from the end."""
    problem, state = cases()[0]
    with pytest.raises(DataError, match="keyframes"):
        keyframe_covariances(problem, state, FreeGauge(), [0, -1])
    with pytest.raises(DataError, match="landmarks"):
        landmark_covariances(problem, state, FreeGauge(), [10**6])


@pytest.mark.parametrize("pair", [(0, 4), (3, 7), (6, 0)])
@pytest.mark.parametrize("case", range(2))
def test_relative_poses_are_gauge_free(case, pair):
    """Catches a derivative of the relative pose that forgets the first rotation's own chart."""
    problem, state = cases()[case]
    i, j = pair
    found = Covariance.of(problem, state).relative_pose(i, j)

    def relative(now):
        R = now.R_WB[i].T @ now.R_WB[j]
        return np.append(now.R_WB[i].T @ (now.p_W[j] - now.p_W[i]), so3.log(R @ found.R.T))

    columns = problem.structure.columns[[i, j]].ravel()
    step = np.zeros(state.n_parameters)

    def moved(delta):
        step[columns] = delta
        return state.retract(step)

    gradient = normal_from(relative, moved, len(columns))
    for gauge in (FreeGauge(), CentroidGauge()):
        expected = gradient.T @ Covariance.of(problem, state).joint(gauge, [i, j]) @ gradient
        assert relative_frobenius(found.covariance, expected) < 1e-6
