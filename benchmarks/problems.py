"""Problems of growing size and fixed track length, the same for every solver.

N = 10 is the paper's simulation with more landmarks. Longer ones fly on along a wave at the same
speed, keyframe spacing, camera and noise; a landmark is seen by a bounded number of consecutive
keyframes, so that work grows with the length of the flight and not with its square.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from vigauge.errors import DataError
from vigauge.geometry.camera import Camera, project
from vigauge.geometry.so3 import Array
from vigauge.model.archive import load_problems, save_problems
from vigauge.model.imu import ImuNoise, preintegrate
from vigauge.model.problem import InertialFactors, Problem
from vigauge.model.state import State
from vigauge.synthetic.measurements import corrupt_imu, ideal_imu
from vigauge.synthetic.scenario import make_scene, make_trial, perturbed, pinhole
from vigauge.synthetic.settings import SimulationSettings
from vigauge.synthetic.spline import SplineTrajectory
from vigauge.synthetic.trajectories import LOOK_ALONG_X, SAMPLES_PER_SECOND

from . import exchange

Index = NDArray[np.int64]

CONFIG = Path(__file__).resolve().parent.parent / "config" / "config.yaml"

SIZES = ((10, 300), (30, 1000), (100, 5000), (300, 20000), (1000, 100000))

# The growth of an iteration with N alone: as many landmarks a keyframe as at N = 100. Not all SIZES have.
GROWTH = ((300, 15000), (1000, 50000))

# Consecutive keyframes that may see a landmark, from ten keyframes on.
TRACK_LENGTHS = (8, 9, 10)
MINIMUM_VIEWS = 3
# Less than this between the first and the last ray and a point is hardly a measurement of anything.
MINIMUM_PARALLAX_RAD = np.radians(2.0)
_BATCH_FACTOR = 1.5


@dataclass(frozen=True)
class Size:
    """One problem: number of keyframes and landmarks, and the seed of everything random in it."""

    n_keyframes: int
    n_landmarks: int
    seed: int = 2018

    @property
    def name(self) -> str:
        return f"n{self.n_keyframes}_k{self.n_landmarks}"

    @property
    def n_parameters(self) -> int:
        return 9 * self.n_keyframes + 3 * self.n_landmarks


def settings_of(size: Size, config: Path = CONFIG) -> SimulationSettings:
    """The paper's experiment, stretched: as many keyframes a second and metres a second as in it."""
    paper = SimulationSettings(**yaml.safe_load(config.read_text(encoding="utf-8"))["simulation"])
    spacing_s = paper.duration_s / (paper.n_keyframes - 1)
    count = round((size.n_keyframes - 1) * spacing_s * paper.imu_rate_hz)
    return replace(
        paper,
        duration_s=count / paper.imu_rate_hz,
        n_keyframes=size.n_keyframes,
        n_landmarks=size.n_landmarks,
        seed=size.seed,
        n_trials=1,
    )


def make_problem(size: Size, config: Path = CONFIG) -> Problem:
    """The problem of a size: the paper's scene up to ten keyframes, a long flight beyond.

    Raises DataError where there are fewer than two keyframes or no landmark.
    """
    if size.n_keyframes < 2 or size.n_landmarks < 1:
        raise DataError("benchmark", "needs two keyframes and a landmark", field="size", value=size.name)
    settings = settings_of(size, config)
    if size.n_keyframes <= 10:
        return make_trial(make_scene("sine", "random", settings), 0)
    return _long_flight(settings)


def _flight(settings: SimulationSettings) -> SplineTrajectory:
    """Waves of the paper's sine along x, at constant speed, the view swaying about it."""
    count = round(SAMPLES_PER_SECOND * settings.duration_s)
    length = settings.path_length_m
    x = np.linspace(0.0, length, 100 * count)
    dense = np.stack([x, 0.35 * np.sin(2.0 * np.pi * x / 2.5), 0.15 * np.sin(2.0 * np.pi * x / 5.0)], axis=1)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(dense, axis=0), axis=1))])
    # The wave is longer than the straight line: as much of it as the flight's length is flown.
    wanted = np.linspace(0.0, length, count)
    points = np.stack([np.interp(wanted, along, dense[:, axis]) for axis in range(3)], axis=1)
    t = np.linspace(0.0, settings.duration_s, count)
    # Periods near those of the paper's 2.5 s flight, so that a long one is no calmer.
    angle = 2.0 * np.pi * t[:, None] * np.array([0.52, 0.36, 0.44]) + np.array([0.3, 1.1, 2.0])
    sway = np.radians(settings.rotation_amplitude_deg) * np.sin(angle) * np.array([0.6, 1.0, 0.5])
    return SplineTrajectory.through(t, points, sway, LOOK_ALONG_X)


def motion_of(settings: SimulationSettings) -> tuple[SplineTrajectory, Index, Index]:
    """The motion of a problem; times of inertial samples and of keyframes, ns."""
    if settings.n_keyframes <= 10:
        scene = make_scene("sine", "random", settings)
        return scene.trajectory, scene.imu.t_ns, scene.keyframe_ns
    step_ns = round(1e9 / settings.imu_rate_hz)
    count = round(settings.duration_s * settings.imu_rate_hz)
    stamps = step_ns * np.arange(count + 1, dtype=np.int64)
    keyframe_ns = stamps[np.round(np.linspace(0, count, settings.n_keyframes)).astype(np.int64)]
    return _flight(settings), stamps, keyframe_ns


def _long_flight(settings: SimulationSettings) -> Problem:
    camera = pinhole(settings)
    motion, stamps, keyframe_ns = motion_of(settings)
    t = keyframe_ns * 1e-9
    p_W, R_WB, v_W = motion.p_W(t), motion.R_WB(t), motion.v_W(t)

    rng = np.random.default_rng([settings.seed, settings.n_keyframes, settings.n_landmarks])
    X_W, keyframe, landmark, uv = _tracks(p_W, R_WB, camera, settings, rng)
    noise = ImuNoise(settings.gyro_density, settings.accel_density)
    # Biases are known and removed (Section II), so the samples are made without.
    samples = corrupt_imu(
        ideal_imu(motion, stamps, settings.gravity_mps2), noise, np.zeros(3), np.zeros(3), rng
    )
    ends = zip(keyframe_ns[:-1], keyframe_ns[1:], strict=True)
    inertial = InertialFactors.chain([preintegrate(samples, int(a), int(b), noise) for a, b in ends])
    truth = State.start(p_W, R_WB, v_W, X_W)
    return Problem.from_observations(
        initial=perturbed(truth, settings, rng),
        cameras=(camera,),
        keyframe=keyframe,
        camera=np.zeros(len(uv), dtype=np.int64),
        landmark=landmark,
        uv=uv + rng.normal(0.0, settings.sigma_px, uv.shape),
        sigma_px=settings.sigma_px,
        inertial=inertial,
        gravity=settings.gravity_mps2,
    )


def _tracks(
    p_W: Array, R_WB: Array, camera: Camera, settings: SimulationSettings, rng: np.random.Generator
) -> tuple[Array, Index, Index, Array]:
    """Landmarks (K, 3) and their exact images: (keyframe, landmark, pixels).

    Batches are drawn until K landmarks are seen often enough and under enough parallax. They are
    numbered in order of first sight, as by a front-end.
    """
    found: list[tuple[Array, Index, Array]] = []
    missing = settings.n_landmarks
    while missing > 0:
        X_W, window, seen, uv = _candidates(
            p_W, R_WB, camera, settings, rng, int(_BATCH_FACTOR * missing) + 50
        )
        good = np.flatnonzero(
            (seen.sum(axis=1) >= MINIMUM_VIEWS) & (_parallax(X_W, p_W, window, seen) >= MINIMUM_PARALLAX_RAD)
        )[:missing]
        if not len(good):
            raise DataError("benchmark", "no landmark is seen often enough", field="n_landmarks")
        row, view = np.nonzero(seen[good])
        found.append(
            (
                X_W[good],
                np.column_stack([window[good][row, view], row + settings.n_landmarks - missing]),
                uv[good][row, view],
            )
        )
        missing -= len(good)
    keyframe, drawn = np.concatenate([part[1] for part in found]).T
    first = np.full(settings.n_landmarks, len(p_W))
    np.minimum.at(first, drawn, keyframe)
    order = np.argsort(first, kind="stable")
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    X_W, uv = (np.concatenate([part[i] for part in found]) for i in (0, 2))
    return X_W[order], keyframe, number[drawn], uv


def _candidates(
    p_W: Array,
    R_WB: Array,
    camera: Camera,
    settings: SimulationSettings,
    rng: np.random.Generator,
    count: int,
) -> tuple[Array, Index, NDArray[np.bool_], Array]:
    """Points X_W (C, 3), the keyframes of each one's window (C, L), which of them see it, and where.

    A point is drawn in the image of the last keyframe of its window, so that those before it,
    farther away on the same course, mostly see it too.
    """
    n = len(p_W)
    length = rng.choice(TRACK_LENGTHS, count)
    # Windows may hang over both ends of the flight, so that its first and last keyframes see as much.
    begin = rng.integers(MINIMUM_VIEWS - length, n - MINIMUM_VIEWS + 1)
    window = begin[:, None] + np.arange(max(TRACK_LENGTHS))
    inside = (np.arange(max(TRACK_LENGTHS)) < length[:, None]) & (window >= 0) & (window < n)
    window = np.clip(window, 0, n - 1)
    last = np.minimum(begin + length, n) - 1
    near, far = settings.landmark_depth_m
    u, v = rng.uniform(0.0, [camera.width - 1, camera.height - 1], (count, 2)).T
    ray_C = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(count)], axis=1)
    points_C = ray_C * rng.uniform(near, far, count)[:, None]
    R_WC = R_WB @ camera.R_BC
    centre_W = p_W + R_WB @ camera.p_BC
    X_W = np.einsum("cij,cj->ci", R_WC[last], points_C) + centre_W[last]

    local = np.einsum("clji,clj->cli", R_WC[window], X_W[:, None] - centre_W[window])
    in_front = local[..., 2] > near / 2.0
    local[..., 2] = np.where(in_front, local[..., 2], 1.0)
    uv, _ = project(local.reshape(-1, 3), camera.fx, camera.fy, camera.cx, camera.cy)
    uv = uv.reshape(*window.shape, 2)
    in_image = np.all((uv >= 0.0) & (uv <= [camera.width - 1, camera.height - 1]), axis=2)
    return X_W, window, inside & in_front & in_image, uv


def _parallax(X_W: Array, p_W: Array, window: Index, seen: NDArray[np.bool_]) -> Array:
    """(C,) angle between the rays of the first and last keyframe that see a point; 0 where none does."""
    rows = np.arange(len(X_W))
    first = window[rows, np.argmax(seen, axis=1)]
    last = window[rows, seen.shape[1] - 1 - np.argmax(seen[:, ::-1], axis=1)]
    a, b = X_W - p_W[first], X_W - p_W[last]
    sine = np.linalg.norm(np.cross(a, b), axis=1)
    return np.arctan2(sine, np.einsum("ci,ci->c", a, b))


def cached_problem(size: Size, folder: Path) -> tuple[Path, Path]:
    """Files of a problem, made if missing: ``.npz`` for Python, ``.bin`` for the C++ program.

    Both hold the same doubles; whatever runs starts from one of them. Their name changes with this
    file, the next, and the configuration.
    """
    sources = (Path(__file__), Path(exchange.__file__), CONFIG)
    recipe = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:8]
    npz, binary = (folder / f"{size.name}_s{size.seed}_{recipe}{ending}" for ending in (".npz", ".bin"))
    if not npz.is_file():
        save_problems(npz, [make_problem(size)])
    if not binary.is_file():
        exchange.write_problem(binary, load_problems(npz)[0])
    return npz, binary
