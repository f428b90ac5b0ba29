"""Inertial factors integrated anew where the linear correction by the biases no longer holds.

Increments follow a change of the biases to first order. What is left out grows with the square of the change
and of the interval, and is soon larger than the noise. Samples are then integrated again at the biases found.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..arrays import instance, integer, integers
from ..errors import DataError
from ..gauge.gauges import Gauge
from ..model.imu import ImuNoise, ImuSamples, preintegrate
from ..model.problem import InertialFactors, Problem
from ..model.state import State
from .levenberg_marquardt import Options, Solution, Status, solve


def reintegrate(
    problem: Problem, state: State, samples: ImuSamples, times_ns: NDArray[np.int64], noise: ImuNoise
) -> Problem:
    """The problem with its inertial factors integrated at the biases of a state.

    Parameters
    ----------
    state : an estimate of the problem
    samples : as the sensor gave them, biases and all
    times_ns : (N,) times of the keyframes, integer nanoseconds
    noise : of the samples, with a random walk of both biases

    Raises DataError where the problem's biases are known, the state is of another size, keyframes of a factor
    are not in the order of time, or samples do not cover a factor.
    """
    instance("problem", problem, Problem).require_fits(state)
    if state.gyro_bias is None or state.accel_bias is None:
        raise DataError("problem", "must estimate biases: known ones do not change", field="biases")
    times = _require_times(problem, times_ns)
    f = problem.inertial
    biases = state.gyro_bias[f.first], state.accel_bias[f.first]
    rows = zip(times[f.first].tolist(), times[f.second].tolist(), *biases, strict=True)
    factors = [preintegrate(samples, a, b, noise, biases=(gyro, accel)) for a, b, gyro, accel in rows]
    chained = InertialFactors.chain(factors, *biases)
    return replace(problem, inertial=replace(chained, first=f.first, second=f.second))


def _require_times(problem: Problem, times_ns: object) -> NDArray[np.int64]:
    times, f = integers("times_ns", times_ns, (problem.initial.n_keyframes,)), problem.inertial
    early = np.flatnonzero(times[f.second] <= times[f.first])
    if len(early):
        row = int(f.second[early[0]])
        raise DataError(
            "times_ns", "must be in the order of the inertial factors", row=row, value=int(times[row])
        )
    return times


def solve_with_samples(
    problem: Problem,
    gauge: Gauge,
    samples: ImuSamples,
    times_ns: NDArray[np.int64],
    noise: ImuNoise,
    options: Options | None = None,
    *,
    rounds: int = 5,
) -> tuple[Problem, Solution]:
    """Solve, integrate anew at the biases found, and solve again from there, until nothing moves.

    Two or three rounds are usual. Arguments as in :func:`reintegrate` and :func:`vigauge.solve`; ``rounds``
    is the largest number of solves.

    Returns the problem as last integrated and the last solution: the estimate is a minimum of that problem,
    and its covariance is that problem's. The status is the iteration limit where ``rounds`` are not enough,
    and that of a solve that did not converge.

    Raises DataError as :func:`reintegrate`.
    """
    if integer("rounds", rounds) < 1:
        raise DataError("rounds", "must be at least 1", value=rounds)
    # A first solve that does not converge would hide what is wrong with these.
    instance("samples", samples, ImuSamples)
    instance("noise", noise, ImuNoise)
    _require_times(instance("problem", problem, Problem), times_ns)
    solution = solve(problem, gauge, options)
    for _ in range(rounds - 1):
        if not solution.converged:
            return problem, solution
        problem = reintegrate(problem, solution.state, samples, times_ns, noise)
        solution = solve(problem, gauge, options, start=solution.state)
        # The first step, not taken, ended the run: the estimate is a minimum where it was integrated.
        if solution.iterations == 1:
            return problem, solution
    return problem, replace(solution, status=Status.ITERATION_LIMIT)
