"""A simulated experiment: one scene, and the problems of its trials."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import DataError
from ..geometry import so3
from ..geometry.camera import Camera
from ..geometry.so3 import Array
from ..model.imu import ImuNoise, ImuSamples, preintegrate
from ..model.problem import InertialFactors, Problem
from ..model.state import State
from .landmarks import LAYOUTS, draw_landmarks
from .measurements import corrupt_imu, ideal_imu, visible_points
from .settings import SimulationSettings
from .spline import SplineTrajectory
from .trajectories import TRAJECTORIES, make_trajectory

Index = NDArray[np.int64]


@dataclass(frozen=True)
class Scene:
    """What is true in all trials: motion, landmarks, and exact measurements.

    ``keyframe``, ``landmark`` (M,) and ``uv`` (M, 2) are the exact observations; ``imu``
    the exact inertial samples; ``keyframe_ns`` (N,) the keyframe times.
    """

    settings: SimulationSettings
    trajectory: SplineTrajectory
    camera: Camera
    keyframe_ns: Index
    truth: State
    keyframe: Index
    landmark: Index
    uv: Array
    imu: ImuSamples


def pinhole(settings: SimulationSettings) -> Camera:
    """The simulated camera: body and camera frames coincide (Section II)."""
    width, height = settings.image_size_px
    focal = 0.5 * width / np.tan(0.5 * np.radians(settings.field_of_view_deg))
    return Camera(
        focal, focal, 0.5 * width, 0.5 * height, width, height, (0.0, 0.0, 0.0, 0.0), np.eye(3), np.zeros(3)
    )


def _times(settings: SimulationSettings) -> tuple[Index, Index]:
    """Inertial stamps over the flight, and keyframe stamps evenly among them; nanoseconds."""
    step_ns = round(1e9 / settings.imu_rate_hz)
    count = round(settings.duration_s * settings.imu_rate_hz)
    stamps = step_ns * np.arange(count + 1, dtype=np.int64)
    return stamps, stamps[np.round(np.linspace(0, count, settings.n_keyframes)).astype(np.int64)]


def make_scene(trajectory: str, points: str, settings: SimulationSettings) -> Scene:
    """The scene of one configuration, e.g. ("sine", "plane").

    Its random numbers depend on the seed and the two names only, not on other settings'
    order of use. Raises DataError where too few landmarks can be seen often enough.
    """
    motion = make_trajectory(trajectory, settings)
    camera = pinhole(settings)
    stamps, keyframe_ns = _times(settings)
    t = keyframe_ns * 1e-9
    p_W, R_WB, v_W = motion.p_W(t), motion.R_WB(t), motion.v_W(t)
    # Streams are told apart by their second number: 0 landmarks, 1 noise, 2 starts (make_trial).
    layout = LAYOUTS.index(points) if points in LAYOUTS else 9
    rng = np.random.default_rng([settings.seed, 0, TRAJECTORIES.index(trajectory), layout])
    candidates = draw_landmarks(points, motion, camera, settings, rng, 4 * settings.n_landmarks + 50)
    _, seen, _ = visible_points(p_W, R_WB, camera, candidates)
    views = np.bincount(seen, minlength=len(candidates))
    chosen = np.flatnonzero(views >= settings.minimum_views)[: settings.n_landmarks]
    if len(chosen) < settings.n_landmarks:
        raise DataError(
            "simulation",
            f"only {len(chosen)} landmarks are seen from {settings.minimum_views} keyframes",
            field="n_landmarks",
            value=settings.n_landmarks,
        )
    X_W = candidates[chosen]
    keyframe, landmark, uv = visible_points(p_W, R_WB, camera, X_W)
    return Scene(
        settings,
        motion,
        camera,
        keyframe_ns,
        State.start(p_W, R_WB, v_W, X_W),
        keyframe,
        landmark,
        uv,
        ideal_imu(motion, stamps, settings.gravity_mps2),
    )


def _unit_vectors(rng: np.random.Generator, count: int) -> Array:
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def perturbed(truth: State, settings: SimulationSettings, rng: np.random.Generator) -> State:
    """A start near the truth (Section V-B): vectors of fixed length for position and rotation,
    uniform in a cube for velocity and landmarks."""
    n, k = truth.n_keyframes, truth.n_landmarks
    turn = np.radians(settings.perturb_rotation_deg) * _unit_vectors(rng, n)
    return State.start(
        p_W=truth.p_W + settings.perturb_position_m * _unit_vectors(rng, n),
        R_WB=so3.exp(turn) @ truth.R_WB,
        v_W=truth.v_W + rng.uniform(-1.0, 1.0, (n, 3)) * settings.perturb_velocity_mps,
        X_W=truth.X_W + rng.uniform(-1.0, 1.0, (k, 3)) * settings.perturb_landmark_m,
    )


def _noise(settings: SimulationSettings) -> ImuNoise:
    return ImuNoise(settings.gyro_density, settings.accel_density)


def _noise_stream(settings: SimulationSettings, trial: int) -> np.random.Generator:
    return np.random.default_rng([settings.seed, 1, trial if settings.redraw_noise else 0])


def _samples(scene: Scene, rng: np.random.Generator) -> ImuSamples:
    s = scene.settings
    gyro_bias, accel_bias = np.array(s.gyro_bias_radps), np.array(s.accel_bias_mps2)
    raw = corrupt_imu(scene.imu, _noise(s), gyro_bias, accel_bias, rng)
    return raw.corrected(gyro_bias, accel_bias)


def measured_imu(scene: Scene, trial: int) -> ImuSamples:
    """The inertial samples of a trial, biases taken off: those that its problem integrates."""
    return _samples(scene, _noise_stream(scene.settings, trial))


def _measured(scene: Scene, rng: np.random.Generator) -> tuple[InertialFactors, Array]:
    s = scene.settings
    samples = _samples(scene, rng)
    ends = zip(scene.keyframe_ns[:-1], scene.keyframe_ns[1:], strict=True)
    factors = InertialFactors.chain([preintegrate(samples, int(a), int(b), _noise(s)) for a, b in ends])
    return factors, scene.uv + rng.normal(0.0, s.sigma_px, scene.uv.shape)


def make_trial(scene: Scene, trial: int) -> Problem:
    """The problem of one trial: its own start and, if ``redraw_noise``, its own noise."""
    s = scene.settings
    start_rng = np.random.default_rng([s.seed, 2, trial])
    inertial, uv = _measured(scene, _noise_stream(s, trial))
    return Problem.from_observations(
        initial=perturbed(scene.truth, s, start_rng),
        cameras=(scene.camera,),
        keyframe=scene.keyframe,
        camera=np.zeros(len(uv), dtype=np.int64),
        landmark=scene.landmark,
        uv=uv,
        sigma_px=s.sigma_px,
        inertial=inertial,
        gravity=s.gravity_mps2,
    )


def make_trials(scene: Scene) -> Iterator[Problem]:
    """The problems of all trials, one after another."""
    return (make_trial(scene, trial) for trial in range(scene.settings.n_trials))
