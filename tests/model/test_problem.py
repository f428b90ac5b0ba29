"""Problems: the order of observations, and bad measurements refused before they reach the solver."""

from dataclasses import replace

import numpy as np
import pytest

from support.random_problem import random_problem, with_noise_of_its_own
from vigauge.errors import DataError
from vigauge.model.imu import ImuNoise, ImuSamples, preintegrate
from vigauge.model.problem import InertialFactors, Problem
from vigauge.solver.residuals import cost

PROBLEM = with_noise_of_its_own(random_problem(0), 0)


def observations(problem: Problem) -> dict:
    return {
        "keyframe": problem.obs_keyframe,
        "camera": problem.obs_camera,
        "landmark": problem.obs_landmark,
        "uv": problem.obs_uv,
        "obs_noise": problem.obs_noise,
    }


def test_observations_may_come_in_any_order():
    """Catches rows of pixels and indices sorted apart: a shuffled problem is the same problem."""
    order = np.random.default_rng(0).permutation(len(PROBLEM.obs_uv))
    shuffled = Problem.from_observations(
        initial=PROBLEM.initial,
        cameras=PROBLEM.cameras,
        sigma_px=PROBLEM.sigma_px,
        inertial=PROBLEM.inertial,
        gravity=PROBLEM.gravity,
        **{name: array[order] for name, array in observations(PROBLEM).items()},
    )
    for name, array in observations(PROBLEM).items():
        assert np.array_equal(observations(shuffled)[name], array)


def test_noise_scales_the_cost():
    """Catches a factor applied to variances instead of deviations, or to the wrong term."""
    state = PROBLEM.initial
    both = cost(PROBLEM.with_noise(2.0 * PROBLEM.sigma_px, 2.0), state)
    assert both == pytest.approx(cost(PROBLEM, state) / 4.0, rel=1e-12)
    visual_only = cost(PROBLEM.with_noise(PROBLEM.sigma_px, 1e9), state)
    inertial_only = cost(PROBLEM.with_noise(1e9, 1.0), state)
    assert visual_only + inertial_only == pytest.approx(cost(PROBLEM, state), rel=1e-9)


def _with(array: np.ndarray, row: int, value) -> np.ndarray:
    array = array.copy()
    array[row] = value
    return array


@pytest.mark.parametrize(
    ("field", "change", "rule"),
    [
        ("obs_keyframe", lambda a: _with(a, 2, 99), "0..3"),
        ("obs_keyframe", lambda a: _with(a, 2, -1), "0..3"),
        ("obs_camera", lambda a: _with(a, 0, 2), "0..1"),
        ("obs_landmark", lambda a: _with(a, -1, 7), "0..6"),
        ("obs_keyframe", lambda a: a[:-1], "shape"),
        ("obs_landmark", lambda a: a[::-1].copy(), "ordered by landmark"),
        ("obs_uv", lambda a: _with(a, 4, np.nan), "finite"),
        ("obs_uv", lambda a: np.column_stack([a, a]), "shape"),
        ("sigma_px", lambda s: 0.0, "positive"),
        ("sigma_px", lambda s: np.nan, "finite"),
        ("obs_noise", lambda s: _with(s, 3, 0.0), "positive"),
        ("obs_noise", lambda s: s[1:], "shape"),
        ("gravity", lambda g: np.nan, "finite"),
    ],
)
def test_bad_measurements_are_refused(field, change, rule):
    """Catches bad numbers let into H: the message names field and rule."""
    with pytest.raises(DataError, match=rule) as caught:
        replace(PROBLEM, **{field: change(getattr(PROBLEM, field))})
    assert caught.value.field == field


BIASED = random_problem(0, biases=True)


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        ({"biases": "known"}, "say biases='estimated'"),
        ({"biases": "guessed"}, "'known' or 'estimated'"),
        ({"initial": PROBLEM.initial}, "with_biases"),
        ({"inertial": PROBLEM.inertial}, "InertialFactors.chain"),
    ],
)
def test_biases_are_everywhere_or_nowhere(change, rule):
    """Catches a state whose biases no factor sees, or factors that follow biases which no state has."""
    with pytest.raises(DataError, match=rule):
        replace(BIASED, **change)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"by_accel_bias": None}, "by_accel_bias"),
        ({"by_gyro_bias": np.zeros((4, 3, 3))}, "by_gyro_bias"),
        ({"covariance": PROBLEM.inertial.covariance}, "covariance"),
        ({"gyro_bias": np.full((4, 3), np.inf)}, "gyro_bias"),
    ],
)
def test_factors_say_all_of_the_biases_or_nothing(change, field):
    """Catches half of what the linear correction needs, or the covariance of known biases."""
    with pytest.raises(DataError) as caught:
        replace(BIASED.inertial, **change)
    assert caught.value.field == field


def test_some_factors_keep_all_that_they_know():
    """Catches rows of one array left behind, or a bias that is lost."""
    for inertial in (PROBLEM.inertial, BIASED.inertial):
        some = inertial.only(np.array([3, 1]))
        assert some.first.tolist() == inertial.first[[3, 1]].tolist()
        assert np.array_equal(some.covariance, inertial.covariance[[3, 1]])
        assert some.has_biases == inertial.has_biases
        assert len(inertial.only(inertial.second > 1).dt) == np.count_nonzero(inertial.second > 1)
    assert np.array_equal(some.by_gyro_bias, inertial.by_gyro_bias[[3, 1]])


def test_biases_without_a_walk_are_refused():
    """Catches an infinite information of the step between two keyframes' biases."""
    samples = ImuSamples(10_000_000 * np.arange(50), np.zeros((50, 3)), np.ones((50, 3)))
    zero = np.zeros(3)
    for walk in ((0.0, 1e-3), (1e-4, 0.0)):
        noise = ImuNoise(1e-3, 1e-2, *walk)
        factors = [preintegrate(samples, a, a + 200_000_000, noise) for a in (0, 200_000_000)]
        assert not InertialFactors.chain(factors).has_biases
        with pytest.raises(DataError, match="gyro_walk="):
            InertialFactors.chain(factors, zero, zero)
    whole = preintegrate(samples, 0, 200_000_000, ImuNoise(1e-3, 1e-2, 1e-4, 1e-3))
    with pytest.raises(DataError, match="accel_bias"):
        InertialFactors.chain([whole], zero, None)


def test_every_landmark_must_be_observed():
    """Catches a landmark without rows, whose block of H is zero."""
    rows = PROBLEM.obs_landmark != 3
    with pytest.raises(DataError, match="observed") as caught:
        replace(
            PROBLEM,
            **{
                f"obs_{name}": getattr(PROBLEM, f"obs_{name}")[rows]
                for name in ("keyframe", "camera", "landmark", "uv")
            },
        )
    assert caught.value.row == 3


def test_observations_of_a_landmark_must_be_ordered_by_keyframe():
    """Catches a silently wrong H: a (landmark, keyframe) pair whose rows do not follow each other
    would be written twice, and the second would wipe out the first."""
    order = np.lexsort((PROBLEM.obs_keyframe, PROBLEM.obs_camera, PROBLEM.obs_landmark))
    with pytest.raises(DataError, match="keyframe"):
        replace(
            PROBLEM,
            obs_keyframe=PROBLEM.obs_keyframe[order],
            obs_camera=PROBLEM.obs_camera[order],
            obs_landmark=PROBLEM.obs_landmark[order],
            obs_uv=PROBLEM.obs_uv[order],
        )


@pytest.mark.parametrize(
    ("field", "change", "rule"),
    [
        ("first", lambda a: _with(a, 1, 4), "0..3"),
        ("second", lambda a: _with(a, 1, PROBLEM.inertial.first[1]), "join two"),
        ("second", lambda a: _with(a, 1, -1), "0..3"),
        ("dp", lambda a: _with(a, 1, np.nan), "finite"),
        ("dR", lambda a: a[:-1], "shape"),
        ("dt", lambda a: _with(a, 1, 0.0), "positive"),
        ("covariance", lambda a: _with(a, 1, -np.eye(9)), "positive definite"),
        ("covariance", lambda a: _with(a, 1, np.nan), "finite"),
    ],
)
def test_bad_inertial_factors_are_refused(field, change, rule):
    """Catches factors that would surface as an index error or a failed factorisation far away."""
    with pytest.raises(DataError, match=rule) as caught:
        replace(
            PROBLEM, inertial=replace(PROBLEM.inertial, **{field: change(getattr(PROBLEM.inertial, field))})
        )
    assert caught.value.field == field


def test_a_chain_of_no_factors():
    """Catches lost trailing axes where there is nothing to stack."""
    empty = InertialFactors.chain([])
    assert empty.dR.shape == (0, 3, 3)
    assert empty.whitener.shape == (0, 9, 9)
