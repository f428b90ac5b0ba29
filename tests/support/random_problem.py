"""A problem with everything switched on at once: two cameras off the body's origin, a first
rotation away from its reference, and large residuals of every kind."""

from dataclasses import replace

import numpy as np

from vigauge.geometry import so3
from vigauge.geometry.camera import Camera
from vigauge.model.problem import InertialFactors, Problem
from vigauge.model.state import State


def stereo_rig(rng: np.random.Generator) -> tuple[Camera, Camera]:
    """Two different cameras, turned and shifted against the body."""
    forward = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    return tuple(
        Camera(
            fx=450.0 + 20.0 * index,
            fy=440.0 - 15.0 * index,
            cx=370.0,
            cy=245.0 + 10.0 * index,
            width=752,
            height=480,
            distortion=(-0.28, 0.07, 2e-4, 2e-5),
            R_BC=so3.exp(rng.normal(0.0, 0.1, 3)) @ forward,
            p_BC=np.array([0.05, 0.06 - 0.11 * index, 0.02]) + rng.normal(0.0, 0.01, 3),
        )
        for index in range(2)
    )


def random_state(rng: np.random.Generator, n_keyframes: int = 4, n_landmarks: int = 7) -> State:
    """Keyframes near the origin that look along +x, landmarks ahead, and dphi_0 far from zero."""
    state = State.start(
        p_W=rng.normal(0.0, 0.5, (n_keyframes, 3)),
        R_WB=so3.exp(rng.normal(0.0, 0.25, (n_keyframes, 3))),
        v_W=rng.normal(0.0, 1.0, (n_keyframes, 3)),
        X_W=rng.normal(0.0, 1.0, (n_landmarks, 3)) + np.array([6.0, 0.0, 0.0]),
    )
    step = np.zeros(state.n_parameters)
    step[3 * n_keyframes : 3 * n_keyframes + 3] = [0.35, -0.2, 0.3]
    return state.retract(step)


def random_factors(rng: np.random.Generator, n_keyframes: int) -> InertialFactors:
    """A chain of factors with full random covariances, and one that jumps back to keyframe 0."""
    first = np.append(np.arange(n_keyframes - 1), n_keyframes - 1)
    second = np.append(np.arange(1, n_keyframes), 0)
    count = len(first)
    root = 0.02 * (np.eye(9) + 0.3 * rng.normal(size=(count, 9, 9)))
    return InertialFactors(
        first=first,
        second=second,
        dt=rng.uniform(0.1, 0.4, count),
        dp=rng.normal(0.0, 0.5, (count, 3)),
        dR=so3.exp(rng.normal(0.0, 0.5, (count, 3))),
        dv=rng.normal(0.0, 1.0, (count, 3)),
        covariance=root @ root.swapaxes(1, 2),
    )


def with_random_biases(problem: Problem, rng: np.random.Generator) -> Problem:
    """The problem with biases to estimate, increments given elsewhere, and full (15, 15) covariances."""
    f, n = problem.inertial, problem.initial.n_keyframes
    count = len(f.dt)
    root = 0.02 * (np.eye(15) + 0.2 * rng.normal(size=(count, 15, 15)))
    biases = {name: rng.normal(0.0, 0.3, (count, 3)) for name in ("gyro_bias", "accel_bias")}
    by = {f"by_{name}": rng.normal(0.0, 0.4, (count, 9, 3)) for name in biases}
    inertial = replace(f, covariance=root @ root.swapaxes(1, 2), **biases, **by)
    initial = problem.initial.with_biases(*rng.normal(0.0, 0.3, (2, n, 3)))
    return replace(problem, initial=initial, inertial=inertial, biases="estimated")


def with_noise_of_its_own(problem: Problem, seed: int) -> Problem:
    """The problem with a factor on the noise of each observation, as of a fisheye."""
    factor = np.random.default_rng(seed).uniform(0.5, 6.0, len(problem.obs_uv))
    return replace(problem, obs_noise=factor)


def random_problem(
    seed: int, n_keyframes: int = 4, n_landmarks: int = 7, window: int | None = None, biases: bool = False
) -> Problem:
    """Landmarks in most keyframes and both cameras; pixels tens of sigma off.

    With a ``window`` a landmark is only seen by so many neighbouring keyframes, as in a flight;
    without one keyframe 0, which has a parametrisation of its own, sees all.
    """
    rng = np.random.default_rng(seed)
    seen = rng.random((n_landmarks, n_keyframes, 2)) < 0.8
    if window is None:
        seen[:, 0] = True
    else:
        first = np.linspace(0, n_keyframes - window, n_landmarks).astype(int)[:, None]
        keyframe = np.arange(n_keyframes)
        seen = (keyframe >= first) & (keyframe < first + window)
        seen = np.repeat(seen[:, :, None], 2, axis=2) & (rng.random((n_landmarks, n_keyframes, 2)) < 0.9)
        seen[np.arange(n_landmarks), first[:, 0] + 1] = True
    landmark, keyframe, camera = np.nonzero(seen)
    shuffled = rng.permutation(len(landmark))
    problem = Problem.from_observations(
        initial=random_state(rng, n_keyframes, n_landmarks),
        cameras=stereo_rig(rng),
        keyframe=keyframe[shuffled],
        camera=camera[shuffled],
        landmark=landmark[shuffled],
        uv=rng.uniform([0.0, 0.0], [752.0, 480.0], (len(landmark), 2)),
        sigma_px=1.7,
        inertial=random_factors(rng, n_keyframes),
        gravity=9.81,
    )
    return with_random_biases(problem, rng) if biases else problem
