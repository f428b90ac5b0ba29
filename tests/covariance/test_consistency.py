"""Chi-square per redundancy of the two groups of measurements."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2

from support import simulated
from vigauge.covariance.consistency import chi_square
from vigauge.gauge.gauges import FreeGauge
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


def test_inertial_share_does_not_see_the_gauge_and_is_part_of_the_whole() -> None:
    """A share that is not the factors' own: the rest would not be positive semidefinite."""
    problem, state = simulated.trial(), simulated.estimate()
    share, whole = inertial_information(problem, state), linearise(problem, state).motion
    rest = np.linalg.eigvalsh(whole - share)
    assert rest.min() > -1e-9 * rest.max()
    velocities = slice(6 * state.n_keyframes, None)
    assert np.allclose(whole[velocities], share[velocities])
