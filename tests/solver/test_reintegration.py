"""Integration anew at the biases found: the minimum does not depend on where samples were integrated."""

from dataclasses import replace

import numpy as np
import pytest

from support.simulated import biased_trial, trial
from vigauge.errors import DataError
from vigauge.gauge.gauges import FixedGauge, FreeGauge, PriorGauge
from vigauge.model.imu import ImuNoise
from vigauge.solver.levenberg_marquardt import Status, solve
from vigauge.solver.reintegration import reintegrate, solve_with_samples
from vigauge.solver.residuals import cost

# Of a cheap sensor, before anyone calibrated it.
LARGE = {"gyro_bias_radps": (0.1, -0.2, 0.15), "accel_bias_mps2": (0.5, -0.4, 0.6)}


def solved(biased, gauge, **options):
    return solve_with_samples(
        biased.problem, gauge, biased.samples, biased.keyframe_ns, biased.noise, **options
    )


@pytest.mark.parametrize("shape", ["sine", "rec"])
def test_large_biases_change_nothing_but_the_biases(shape):
    """Catches factors integrated at another keyframe's bias, or a loop that ends too early: the same noise
    with large and with small biases has the same minimum, which the linear correction alone misses."""
    small, large = biased_trial(1, shape), biased_trial(1, shape, **LARGE)
    (_, near), (problem, far) = (solved(biased, FreeGauge(), rounds=3) for biased in (small, large))
    assert near.converged and far.converged
    assert far.cost == pytest.approx(near.cost, rel=1e-5)
    for name in ("gyro_bias", "accel_bias"):
        errors = [getattr(s.state, name) - getattr(b.truth, name) for s, b in ((near, small), (far, large))]
        assert np.abs(errors[0] - errors[1]).max() < 0.02 * np.abs(errors[0]).max()
        integrated = getattr(problem.inertial, name)
        assert np.abs(integrated - getattr(far.state, name)[:-1]).max() < 1e-2 * np.abs(errors[0]).max()
    once = solve(large.problem, FreeGauge())
    there = reintegrate(large.problem, once.state, large.samples, large.keyframe_ns, large.noise)
    assert cost(there, once.state) > 1.01 * far.cost
    assert cost(problem, far.state) == pytest.approx(far.cost, rel=1e-12)


@pytest.mark.parametrize("gauge", [FixedGauge(), PriorGauge(1e5)], ids=lambda gauge: gauge.name)
def test_later_rounds_keep_the_gauge(gauge):
    """Catches a prior that is pulled along to the estimate of the round before."""
    biased = biased_trial(1, "rec", **LARGE)
    problem, solution = solved(biased, gauge)
    assert problem.initial is biased.problem.initial
    assert np.abs(solution.state.p_W[0] - problem.initial.p_W[0]).max() < 1e-5
    assert abs(solution.state.dphi_0[2]) < 1e-5


def test_too_few_rounds_are_no_convergence():
    """Catches an estimate handed on as a minimum that it is not."""
    _, solution = solved(biased_trial(1, "rec", **LARGE), FreeGauge(), rounds=1)
    assert solution.status is Status.ITERATION_LIMIT
    with pytest.raises(DataError, match="at least 1"):
        solved(biased_trial(1), FreeGauge(), rounds=0)


def test_what_cannot_be_integrated_is_refused():
    """Catches known biases taken for zero, and times of other keyframes."""
    biased = biased_trial(1)
    problem, state = biased.problem, biased.problem.initial
    rest = biased.samples, biased.keyframe_ns, biased.noise
    with pytest.raises(DataError, match="must estimate biases"):
        reintegrate(trial(1), trial(1).initial, *rest)
    with pytest.raises(DataError, match="shape"):
        reintegrate(problem, state, rest[0], rest[1][1:], rest[2])
    with pytest.raises(DataError, match="order of the inertial"):
        reintegrate(problem, state, rest[0], rest[1][::-1].copy(), rest[2])
    with pytest.raises(DataError, match="cover"):
        reintegrate(problem, state, rest[0], rest[1] + 10**9, rest[2])
    with pytest.raises(DataError, match="gyro_walk="):
        reintegrate(problem, state, *rest[:2], replace(ImuNoise(1e-3, 1e-2)))
