"""Outlier removal by solving and dropping."""

from dataclasses import replace

import numpy as np
import pytest

from support import simulated
from vigauge.errors import SolverError
from vigauge.model.loss import Huber
from vigauge.recordings.frontend.outliers import find_inliers, reprojection_px, without
from vigauge.recordings.frontend.settings import OutlierSettings

# The simulated noise is one pixel, so four are safe.
SETTINGS = OutlierSettings(reprojection_px=5.0, sigma_px=1.0, density_factor=1.0)


def spoilt(share: float = 0.03) -> tuple:
    """A simulated problem with some observations far off, and which."""
    problem = simulated.trial(0)
    rng = np.random.default_rng(0)
    wrong = np.zeros(len(problem.obs_uv), dtype=bool)
    # At most one a landmark, so that the rest can tell.
    landmarks = rng.choice(problem.initial.n_landmarks, int(share * len(wrong)), replace=False)
    wrong[[rng.choice(np.flatnonzero(problem.obs_landmark == k)) for k in landmarks]] = True
    direction = rng.standard_normal((len(wrong), 2))
    direction *= 40.0 / np.linalg.norm(direction, axis=1)[:, None]
    return replace(problem, obs_uv=problem.obs_uv + np.where(wrong[:, None], direction, 0.0)), wrong


def test_wrong_observations_go_and_good_ones_stay() -> None:
    """Good observations dropped for the errors that bad ones cause, since all are judged at once."""
    problem, wrong = spoilt()
    assert wrong.sum() >= 3
    result = find_inliers(problem, SETTINGS, 2)
    assert not np.any(result.observation & wrong)
    assert np.count_nonzero(~result.observation & ~wrong) <= 0.03 * len(wrong)
    assert result.rounds >= 2
    assert len(result.error_after_px) == np.count_nonzero(result.observation)
    assert np.median(result.error_after_px) < np.median(result.error_before_px)
    assert result.error_after_px.max() <= SETTINGS.reprojection_px


def test_clean_problem_loses_nothing() -> None:
    """A threshold in whitened units or in squares."""
    problem = simulated.trial(0)
    result = find_inliers(problem, SETTINGS, 2)
    assert np.all(result.observation) and result.rounds == 1


def test_no_rounds_keep_everything() -> None:
    """rounds = 0 must switch the stage off, not fail."""
    problem, _ = spoilt()
    result = find_inliers(problem, replace(SETTINGS, rounds=0), 2)
    assert np.all(result.observation) and result.rounds == 0


def test_landmark_left_with_too_few_keyframes_goes_altogether() -> None:
    """A landmark of one keyframe stays, whose depth nothing holds."""
    problem = simulated.trial(0)
    seen = np.bincount(problem.obs_landmark)
    result = find_inliers(problem, SETTINGS, int(seen.min()) + 1)
    left = np.bincount(problem.obs_landmark[result.observation], minlength=len(seen))
    assert np.all((left == 0) | (left > seen.min()))
    assert np.any(left == 0) and np.any(left > 0)


def test_reduced_problem_keeps_pixels_with_their_landmarks() -> None:
    """Landmarks renumbered in one array and not in the other: same residuals or it is wrong. A lost loss."""
    problem = replace(simulated.trial(0), loss=Huber(2.0))
    keep = problem.obs_landmark % 3 != 1
    reduced, landmarks = without(problem, keep, problem.initial)
    np.testing.assert_array_equal(landmarks, np.flatnonzero(np.arange(problem.initial.n_landmarks) % 3 != 1))
    before = reprojection_px(problem, problem.initial)[keep]
    np.testing.assert_allclose(reprojection_px(reduced, reduced.initial), before, rtol=1e-12)
    assert reduced.loss == problem.loss


def test_round_that_does_not_converge_is_an_error() -> None:
    """Observations judged at a state that is no minimum."""
    problem = simulated.trial(0)
    at_the_camera = np.zeros_like(problem.initial.X_W) + problem.initial.p_W[0]
    broken = problem.with_initial(replace(problem.initial, X_W=at_the_camera))
    with np.errstate(all="ignore"), pytest.raises(SolverError, match="round 1"):
        find_inliers(broken, SETTINGS, 2)
