"""Chi-square per redundancy of the two groups of measurements; NEES and its band."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from support import simulated
from vigauge.covariance.consistency import chi_square, mean_nees_band, nees
from vigauge.errors import DataError
from vigauge.gauge.gauges import FreeGauge
from vigauge.model.loss import Huber
from vigauge.solver.levenberg_marquardt import solve
from vigauge.solver.normal_equations import inertial_information, linearise


def test_both_groups_are_near_one_when_the_noise_is_right() -> None:
    """A redundancy that is off: then a right noise model looks wrong, or a wrong one right."""
    totals = np.zeros(4)
    for number in range(12):
        problem = simulated.trial(number)
        found = chi_square(problem, solve(problem, FreeGauge()).state)
        totals += [
            found.visual * found.visual_redundancy,
            found.visual_redundancy,
            found.inertial * found.inertial_redundancy,
            found.inertial_redundancy,
        ]
    for total, redundancy in totals.reshape(2, 2):
        low, high = chi2.interval(0.999, redundancy)
        assert low < total < high


def test_believing_twice_the_noise_quarters_chi_square() -> None:
    problem = simulated.trial()
    state = simulated.estimate()
    one = chi_square(problem, state)
    two = chi_square(problem.with_noise(2.0 * problem.sigma_px, 2.0), state)
    assert np.isclose(two.visual, one.visual / 4.0)
    assert np.isclose(two.inertial, one.inertial / 4.0)
    assert np.isclose(two.inertial_redundancy, one.inertial_redundancy)


def test_no_chi_square_of_a_loss() -> None:
    """Catches squares of outliers compared with redundancies of weighted rows."""
    with pytest.raises(DataError, match="problem, loss: must have no loss"):
        chi_square(replace(simulated.trial(), loss=Huber(2.0)), simulated.estimate())


def test_inertial_share_does_not_see_the_gauge_and_is_part_of_the_whole() -> None:
    """A share that is not the factors' own: the rest would not be positive semidefinite."""
    problem, state = simulated.trial(), simulated.estimate()
    share, whole = inertial_information(problem, state), linearise(problem, state).motion
    rest = np.linalg.eigvalsh(whole - share)
    assert rest.min() > -1e-9 * rest.max()
    velocities = slice(6 * state.n_keyframes, None)
    assert np.allclose(whole[velocities], share[velocities])


def singular() -> tuple[np.ndarray, np.ndarray]:
    """A (9, 9) covariance of rank 6 in units a million apart, with a held row, and an error in its gauge."""
    rng = np.random.default_rng(4)
    root = rng.normal(size=(9, 6)) * np.repeat([1e-3, 1.0, 1e3], 3)[:, None]
    root[4] = 0.0
    return root @ root.T, root @ rng.normal(size=6)


def test_nees_is_that_of_the_pseudo_inverse() -> None:
    """Catches rows that are dependent taken for independent where units differ."""
    covariance, error = singular()
    scale = np.repeat([1e3, 1.0, 1e-3], 3)
    expected = scale * error @ np.linalg.pinv(scale[:, None] * covariance * scale) @ (scale * error)
    assert nees(error, covariance, 6) == pytest.approx(expected, rel=1e-9)
    assert nees(3.0 * error, covariance, 6) == pytest.approx(9.0 * expected, rel=1e-9)


def test_errors_outside_the_gauge_are_refused() -> None:
    """Catches an error that nobody took to the gauge: its share along the orbit would be lost."""
    covariance, error = singular()
    with pytest.raises(DataError, match=r"error, row 4: must be in the gauge"):
        nees(error + np.eye(9)[4], covariance, 6)
    with pytest.raises(DataError, match="must be in the gauge"):
        nees(error, covariance, 5)
    with pytest.raises(DataError, match="must have rank 7"):
        nees(error, covariance, 7)
    for dof in (0, 10):
        with pytest.raises(DataError, match=r"dof: must be in 1\.\.9"):
            nees(error, covariance, dof)


def test_band_is_that_of_a_mean_of_chi_squares() -> None:
    low, high = mean_nees_band(86, 200, 0.99)
    assert (low, high) == pytest.approx(np.array(chi2.interval(0.99, 86 * 200)) / 200)
    for dof, trials, confidence in ((0, 5, 0.9), (5, 0, 0.9), (5, 5, 1.0)):
        with pytest.raises(DataError):
            mean_nees_band(dof, trials, confidence)
