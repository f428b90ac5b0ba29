"""A problem with one thing changed that the paper leaves open: what its errors depend on.

Each function returns a new problem; measurements that stay are the same numbers.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vigauge.errors import DataError
from vigauge.geometry import so3
from vigauge.geometry.so3 import Array
from vigauge.model.imu import ImuSamples
from vigauge.model.problem import InertialFactors, Problem
from vigauge.model.state import State

# Constant errors of the accelerometer along an axis of the body, m/s^2, and the axis.
ACCEL_ERRORS = {f"accel_error_{axis}_mps2": row for row, axis in enumerate("xyz")}


def _kept(problem: Problem, observation: NDArray[np.bool_], minimum_views: int) -> Problem:
    """The observations that ``observation`` marks, of landmarks that so keep enough keyframes."""
    pairs = np.column_stack([problem.obs_landmark, problem.obs_keyframe])[observation]
    first = np.ones(len(pairs), dtype=bool)
    first[1:] = np.any(np.diff(pairs, axis=0) != 0, axis=1)
    views = np.bincount(pairs[first, 0], minlength=problem.initial.n_landmarks)
    good = views >= minimum_views
    if not good.any():
        raise DataError(
            "problem", f"no landmark is left with {minimum_views} keyframes", field="obs_landmark"
        )
    number = np.cumsum(good) - 1
    keep = observation & good[problem.obs_landmark]
    state = problem.initial
    return Problem.from_observations(
        initial=State(state.p_W, state.R_WB, state.v_W, state.X_W[good], state.dphi_0, state.R_WB0_ref),
        cameras=problem.cameras,
        keyframe=problem.obs_keyframe[keep],
        camera=problem.obs_camera[keep],
        landmark=number[problem.obs_landmark[keep]],
        uv=problem.obs_uv[keep],
        sigma_px=problem.sigma_px,
        inertial=problem.inertial,
        gravity=problem.gravity,
    )


def one_camera(problem: Problem, camera: int = 0, minimum_views: int = 2) -> Problem:
    """Only what one camera saw: landmarks with fewer keyframes than ``minimum_views`` go.

    Raises DataError where none is left.
    """
    return _kept(problem, problem.obs_camera == camera, minimum_views)


def fewer_landmarks(
    problem: Problem, count: int, rng: np.random.Generator, minimum_views: int = 2
) -> Problem:
    """A random choice of ``count`` landmarks (all, where there are no more)."""
    total = problem.initial.n_landmarks
    chosen = np.zeros(total, dtype=bool)
    chosen[rng.choice(total, size=min(count, total), replace=False)] = True
    return _kept(problem, chosen[problem.obs_landmark], minimum_views)


def keyframes_between(
    problem: Problem, truth: State, start: int, stop: int, minimum_views: int = 2
) -> tuple[Problem, State]:
    """The problem and its true states from keyframe ``start`` up to, not including, ``stop``."""
    inside = (problem.obs_keyframe >= start) & (problem.obs_keyframe < stop)
    left = _kept(problem, inside, minimum_views)
    factors = problem.inertial
    kept = (factors.first >= start) & (factors.second < stop)
    chain = InertialFactors(
        first=factors.first[kept] - start,
        second=factors.second[kept] - start,
        dt=factors.dt[kept],
        dp=factors.dp[kept],
        dR=factors.dR[kept],
        dv=factors.dv[kept],
        covariance=factors.covariance[kept],
    )
    part = replace(
        left,
        initial=_states_between(left.initial, start, stop),
        obs_keyframe=left.obs_keyframe - start,
        inertial=chain,
    )
    return part, _states_between(truth, start, stop)


def _states_between(state: State, start: int, stop: int) -> State:
    return State.start(state.p_W[start:stop], state.R_WB[start:stop], state.v_W[start:stop], state.X_W)


def with_bias_error(problem: Problem, gyro: Array, accel: Array) -> Problem:
    """Increments as they come out where biases (rad/s, m/s^2; (3,)) are left in, to first order.

    The bias is constant in the body frame, which turns little between keyframes.
    """
    factors = problem.inertial
    dt = factors.dt[:, None]
    return replace(
        problem,
        inertial=replace(
            factors,
            dp=factors.dp + 0.5 * dt**2 * accel,
            dv=factors.dv + dt * accel,
            dR=factors.dR @ so3.exp(dt * gyro),
        ),
    )


def euler_increments(
    samples: ImuSamples, ends_ns: list[tuple[int, int]], factors: InertialFactors
) -> InertialFactors:
    """The increments of ``factors`` integrated by Euler steps: each sample holds until the next.

    ``ends_ns``: start and end of each interval, stamps of samples. The covariances stay.
    """
    dp, dR, dv = [], [], []
    for start, end in ends_ns:
        low, high = np.searchsorted(samples.t_ns, [start, end])
        position, velocity, rotation = np.zeros(3), np.zeros(3), np.eye(3)
        for k, h in zip(range(low, high), np.diff(samples.t_ns[low : high + 1]) * 1e-9, strict=True):
            force = rotation @ samples.accel[k]
            position = position + velocity * h + 0.5 * force * h * h
            velocity = velocity + force * h
            rotation = rotation @ so3.exp(samples.gyro[k] * h)
        dp.append(position)
        dR.append(rotation)
        dv.append(velocity)
    return replace(factors, dp=np.array(dp), dR=np.array(dR), dv=np.array(dv))
