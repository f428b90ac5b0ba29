"""Covariances of problems with biases: 15 parameters a keyframe, in every gauge, dense and banded."""

from functools import cache

import numpy as np
import pytest

from support.gauged import motion_pseudo_inverse
from support.random_problem import random_problem
from support.simulated import TIGHT, biased_estimate, biased_trial
from vigauge.covariance.consistency import mean_nees_band, nees
from vigauge.covariance.covariance import Covariance
from vigauge.covariance.projection import along_orbit, oblique_projector
from vigauge.covariance.transform import transform_covariance
from vigauge.gauge.gauges import CentroidGauge, FixedGauge, FreeGauge, Gauge, KeyframeGauge, PriorGauge
from vigauge.gauge.group import orbit_tangent
from vigauge.geometry.so3 import Array
from vigauge.model.evaluation import align_all_poses, relative_frobenius
from vigauge.solver.levenberg_marquardt import solve
from vigauge.solver.normal_equations import linearise

SHAPES = ("sine", "arc", "rec")
GAUGES = (FreeGauge(), FixedGauge(), KeyframeGauge(3), CentroidGauge(), PriorGauge(1e3))


def covariance(kind: str) -> Covariance:
    """Of a simulated problem at its minimum, or of a long flight whose system is a band."""
    if kind in SHAPES:
        return Covariance.of(biased_trial(0, kind).problem, biased_estimate(0, kind))
    flight = random_problem(4, n_keyframes=30, n_landmarks=90, window=4, biases=True)
    return Covariance.of(flight, flight.initial)


@cache
def whole(kind: str) -> Array:
    """(n, n) covariance of all parameters in the fixed gauge, by dense linear algebra."""
    found = covariance(kind)
    H = found.equations.dense()
    keep = np.setdiff1d(np.arange(len(H)), FixedGauge().held(found.state))
    scale = 1.0 / np.sqrt(np.diagonal(H)[keep])
    unit = H[np.ix_(keep, keep)] * scale[:, None] * scale
    inverse = np.linalg.inv(unit)
    inverse = 2.0 * inverse - inverse @ unit @ inverse  # a Newton step for the last digits
    out = np.zeros_like(H)
    out[np.ix_(keep, keep)] = inverse * scale[:, None] * scale
    return out


def in_gauge(kind: str, gauge: Gauge) -> Array:
    """(n, n) covariance in a gauge by the dense projector of Eq. (14)."""
    found = covariance(kind)
    U, V = orbit_tangent(found.state), gauge.normal(found.state)
    Q = oblique_projector(U, V)
    out = Q @ whole(kind) @ Q.T
    if isinstance(gauge, PriorGauge):
        freedom = U @ np.linalg.inv(V.T @ U)
        out = out + freedom @ freedom.T / gauge.weight
    return out


@pytest.mark.parametrize("kind", SHAPES)
def test_four_directions_are_unobservable(kind):
    """Catches a fifth null direction or a lost one: rank n - 4, with a clear gap."""
    found = covariance(kind)
    values = np.abs(found.spectrum().eigenvalues)
    assert values[3] < 1e-12 < 1e-7 < values[4]
    H, U = found.equations.dense(), orbit_tangent(found.state)
    scale = np.sqrt(np.diagonal(H))
    assert np.abs(H @ U / scale[:, None]).max() < 1e-7 * np.abs(scale[:, None] * U).max()
    assert not U[9 * 10 : 15 * 10].any()


@pytest.mark.parametrize("gauge", GAUGES, ids=lambda gauge: gauge.name)
@pytest.mark.parametrize("kind", ["sine", "band"])
def test_every_gauge_is_the_dense_projection(kind, gauge):
    """Catches a block of 9 where a keyframe has 15: motion, single keyframes, some together, landmarks."""
    found, expected = covariance(kind), in_gauge(kind, gauge)
    assert found.reduced.structure.layout.banded == (kind == "band")
    n = found.state.n_motion
    columns = found.reduced.structure.columns
    assert columns.shape == (found.state.n_keyframes, 15)
    motion = found.motion(gauge)
    assert relative_frobenius(motion, expected[:n, :n]) < 1e-8
    blocks = found.keyframes(gauge)
    for i, at in enumerate(columns):
        scale = np.sqrt(np.abs(np.diagonal(expected)[at])) + 1e-10  # of what is held: rounding alone
        assert np.abs((blocks[i] - expected[np.ix_(at, at)]) / np.outer(scale, scale)).max() < 1e-6
    some = [5, 0, 8]
    at = columns[some].ravel()
    assert relative_frobenius(found.joint(gauge, some), expected[np.ix_(at, at)]) < 1e-8
    landmarks = found.landmarks(gauge, [0, 4])
    for j, block in zip((0, 4), landmarks, strict=True):
        at = n + 3 * j + np.arange(3)
        assert relative_frobenius(block, expected[np.ix_(at, at)]) < 1e-7


@pytest.mark.parametrize("kind", SHAPES)
def test_transformed_free_covariance_is_the_fixed_one(kind, record_property):
    """Catches biases that turn with the world in (12): at one point it is an identity."""
    problem = biased_trial(0, kind).problem
    state, _ = FixedGauge().meet(biased_estimate(0, kind), problem.initial)
    free = motion_pseudo_inverse(linearise(problem, state), state)
    fixed = Covariance.of(problem, state).motion(FixedGauge())
    transformed, _ = transform_covariance(free, state, FixedGauge(), problem.initial)
    record_property("same_point", relative_frobenius(transformed, fixed))
    assert relative_frobenius(transformed, fixed) < 1e-9
    far = state.transformed(1.1, np.array([3.0, -2.0, 1.0]))
    transformed, moved = transform_covariance(
        Covariance.of(problem, far).motion(FreeGauge()), far, FixedGauge(), problem.initial
    )
    assert relative_frobenius(transformed, Covariance.of(problem, moved).motion(FixedGauge())) < 1e-9
    assert np.array_equal(moved.accel_bias, far.accel_bias)


def test_relative_poses_do_not_see_the_gauge():
    """Catches the second pose taken at the place that it has without biases."""
    found = covariance("rec")
    by_gauge = [found.relative_pose(2, 7, gauge).covariance for gauge in (FixedGauge(), CentroidGauge())]
    assert relative_frobenius(*by_gauge) < 1e-9
    assert np.linalg.eigvalsh(by_gauge[0])[0] > 0.0


def test_errors_are_as_large_as_the_covariance_says(record_property):
    """Catches sigmas of biases, or of what they spoil, that are not those of the errors: the mean NEES over
    200 trials lies in its 99 % band, and is the same in three gauges."""
    gauges, trials = (FixedGauge(), KeyframeGauge(5), CentroidGauge()), 200
    found = np.empty((trials, len(gauges) + 1))
    for number in range(trials):
        biased = biased_trial(number, n_landmarks=100)
        problem, truth = biased.problem.with_initial(biased.truth), biased.truth
        # Near the truth on the orbit, the error's way to a gauge is the linear one of Eq. (14).
        state = align_all_poses(solve(problem, FreeGauge(), TIGHT).state, truth)
        at_state, error, n = Covariance.of(problem, state), state.local(truth), state.n_motion
        for place, gauge in enumerate(gauges):
            V = gauge.normal(state)
            there = (error - along_orbit(at_state.U, V) @ (V.T @ error))[:n]
            found[number, place] = nees(there, at_state.motion(gauge), n - 4)
        biases = slice(9 * state.n_keyframes, n)
        found[number, -1] = nees(error[biases], at_state.motion(gauges[0])[biases, biases], 60)
    means = found.mean(axis=0)
    record_property("mean_nees", means.tolist())
    assert np.allclose(found[:, 0], found[:, 1], rtol=1e-6) and np.allclose(
        found[:, 0], found[:, 2], rtol=1e-6
    )
    for mean, dof in zip(means, (146, 146, 146, 60), strict=True):
        low, high = mean_nees_band(dof, trials)
        assert low < mean < high
