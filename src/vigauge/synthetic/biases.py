"""Trials whose biases are unknown and walk: to be estimated with the rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..model.imu import ImuNoise, ImuSamples, preintegrate
from ..model.problem import InertialFactors, Problem
from ..model.state import State
from .measurements import corrupt_imu, random_walk
from .scenario import Scene, make_trial


@dataclass(frozen=True, eq=False)
class BiasedTrial:
    """A problem with biases to estimate.

    ``truth``: its true state, biases included; ``samples``: what the sensor gave, biases and all; ``noise``:
    that of the samples; ``keyframe_ns`` (N,): times of the keyframes.
    """

    problem: Problem
    truth: State
    samples: ImuSamples
    noise: ImuNoise
    keyframe_ns: NDArray[np.int64]


def make_biased_trial(scene: Scene, trial: int, gyro_walk: float, accel_walk: float) -> BiasedTrial:
    """A trial as :func:`make_trial` makes it, with biases that begin at the settings' and walk.

    ``gyro_walk`` in rad/s^2/sqrt(Hz), ``accel_walk`` in m/s^3/sqrt(Hz). The increments, and the start, are at
    biases of zero: the estimator knows nothing of the true ones.
    """
    s = scene.settings
    noise = ImuNoise(s.gyro_density, s.accel_density, gyro_walk, accel_walk)
    # Streams 0 to 2 are those of landmarks, noise and starts (make_scene, make_trial).
    rng = np.random.default_rng([s.seed, 3, trial])
    gyro_bias = random_walk(s.gyro_bias_radps, gyro_walk, scene.imu.t_ns, rng)
    accel_bias = random_walk(s.accel_bias_mps2, accel_walk, scene.imu.t_ns, rng)
    samples = corrupt_imu(scene.imu, noise, gyro_bias, accel_bias, rng)
    ends = zip(scene.keyframe_ns[:-1], scene.keyframe_ns[1:], strict=True)
    factors = [preintegrate(samples, int(a), int(b), noise) for a, b in ends]
    zero = np.zeros(3)
    known = make_trial(scene, trial)
    problem = replace(
        known,
        initial=known.initial.with_biases(zero, zero),
        inertial=InertialFactors.chain(factors, zero, zero),
        biases="estimated",
    )
    at = np.searchsorted(scene.imu.t_ns, scene.keyframe_ns)
    truth = scene.truth.with_biases(gyro_bias[at], accel_bias[at])
    return BiasedTrial(problem, truth, samples, noise, scene.keyframe_ns)
