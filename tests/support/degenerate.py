"""Problems of a prescribed motion, exactly measured: what is unobservable is so to rounding."""

from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np

from vigauge.geometry import so3
from vigauge.geometry.camera import Camera
from vigauge.model.imu import ImuNoise, ImuSamples, preintegrate
from vigauge.model.problem import InertialFactors, Problem
from vigauge.model.state import State
from vigauge.solver.residuals import visual_residual

FORWARD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
G = 9.81
DT = 0.3
SIGMA_PX = 1.0
# Standard deviations of (dp m, rotation rad, dv m/s) of one factor.
SIGMA_INERTIAL = np.repeat([0.01, 0.005, 0.02], 3)

Path = Callable[[np.ndarray], np.ndarray]


def rig(stereo: bool) -> tuple[Camera, ...]:
    """One camera that looks along x, or two 0.1 m apart."""
    sides = (0.05, -0.05) if stereo else (0.0,)
    return tuple(
        Camera(300.0, 300.0, 320.0, 240.0, 640, 480, (0.0,) * 4, FORWARD, np.array([0.02, side, 0.01]))
        for side in sides
    )


def accelerated(t: np.ndarray) -> np.ndarray:
    """A path with acceleration that changes on all axes."""
    return np.stack([0.8 * np.sin(1.3 * t), 0.7 * np.cos(1.1 * t), 0.4 * np.sin(1.7 * t + 0.4)], axis=1)


def swaying(t: np.ndarray) -> np.ndarray:
    return 0.15 * np.stack([np.sin(1.9 * t), np.cos(1.4 * t + 0.2), np.sin(1.2 * t)], axis=1)


def still(t: np.ndarray) -> np.ndarray:
    return np.zeros((len(t), 3))


def straight(t: np.ndarray) -> np.ndarray:
    """Constant velocity."""
    return t[:, None] * np.array([0.3, 0.9, -0.2])


def falling(t: np.ndarray) -> np.ndarray:
    """Constant acceleration."""
    return 0.5 * t[:, None] ** 2 * np.array([0.4, -0.3, 0.2]) + straight(t)


def scattered(rng: np.random.Generator, count: int) -> np.ndarray:
    return np.array([5.0, 0.0, 0.0]) + rng.uniform(-1.0, 1.0, (count, 3)) * [2.0, 1.5, 1.5]


def coplanar(rng: np.random.Generator, count: int) -> np.ndarray:
    """Exactly on one plane, askew to the view."""
    points = scattered(rng, count)
    points[:, 0] = 5.0 + 0.3 * points[:, 1] - 0.2 * points[:, 2]
    return points


def exact_factors(truth: State, links: Collection[tuple[int, int]]) -> InertialFactors:
    """Noise-free increments between keyframes ``DT`` apart by number."""
    first = np.array([a for a, _ in links], dtype=np.int64)
    second = np.array([b for _, b in links], dtype=np.int64)
    dt = DT * (second - first)
    g_W = np.array([0.0, 0.0, -G])
    R_T = truth.R_WB[first].swapaxes(1, 2)
    shift = truth.p_W[second] - truth.p_W[first] - truth.v_W[first] * dt[:, None]
    return InertialFactors(
        first=first,
        second=second,
        dt=dt,
        dp=np.einsum("fij,fj->fi", R_T, shift - 0.5 * g_W * dt[:, None] ** 2),
        dR=R_T @ truth.R_WB[second],
        dv=np.einsum("fij,fj->fi", R_T, truth.v_W[second] - truth.v_W[first] - g_W * dt[:, None]),
        covariance=np.broadcast_to(np.diag(SIGMA_INERTIAL**2), (len(dt), 9, 9)).copy(),
    )


def problem_of(
    path: Path = accelerated,
    turn: Path = swaying,
    *,
    n_keyframes: int = 8,
    stereo: bool = False,
    landmarks: Callable[[np.random.Generator, int], np.ndarray] = scattered,
    n_landmarks: int = 20,
    links: Collection[tuple[int, int]] | None = None,
    sees: Callable[[np.ndarray, np.ndarray], np.ndarray] = lambda keyframe, landmark: keyframe >= 0,
) -> Problem:
    """Every landmark in every view for which ``sees(keyframe, landmark)``; inertial factors along
    ``links``, by default a chain. The initial state is the truth, at which all residuals are zero."""
    t = DT * np.arange(n_keyframes)
    step = 1e-5
    X_W = landmarks(np.random.default_rng(1), n_landmarks)
    truth = State.start(path(t), so3.exp(turn(t)), (path(t + step) - path(t - step)) / (2 * step), X_W)
    if links is None:
        links = [(i, i + 1) for i in range(n_keyframes - 1)]
    cameras = rig(stereo)
    landmark, keyframe, camera = (
        index.ravel()
        for index in np.meshgrid(
            np.arange(n_landmarks), np.arange(n_keyframes), np.arange(len(cameras)), indexing="ij"
        )
    )
    seen = sees(keyframe, landmark)
    landmark, keyframe, camera = landmark[seen], keyframe[seen], camera[seen]
    blank = Problem.from_observations(
        truth,
        cameras,
        keyframe,
        camera,
        landmark,
        np.zeros((len(landmark), 2)),
        SIGMA_PX,
        exact_factors(truth, links),
        G,
    )
    return Problem.from_observations(
        truth,
        cameras,
        blank.obs_keyframe,
        blank.obs_camera,
        blank.obs_landmark,
        visual_residual(blank, truth) * SIGMA_PX,
        SIGMA_PX,
        blank.inertial,
        G,
    )


# Of the noise of the samples in :func:`with_biases`.
NOISE = ImuNoise(1e-3, 1e-2, gyro_walk=1e-3, accel_walk=1e-2)


def with_biases(problem: Problem, path: Path = accelerated, turn: Path = swaying) -> Problem:
    """The problem with biases to estimate, its chain integrated from samples of the same motion at 200 Hz."""
    n, step_ns = problem.initial.n_keyframes, 5_000_000
    t_ns = np.arange(0, round(DT * (n - 1) * 1e9) + 1, step_ns)
    t, h, g_W = t_ns * 1e-9, 1e-4, np.array([0.0, 0.0, -G])
    R = so3.exp(turn(t))
    gyro = so3.log(so3.exp(turn(t - h)).swapaxes(1, 2) @ so3.exp(turn(t + h))) / (2.0 * h)
    force_W = (path(t + h) - 2.0 * path(t) + path(t - h)) / h**2 - g_W
    samples = ImuSamples(t_ns, gyro, np.einsum("kji,kj->ki", R, force_W))
    ends = np.round(DT * 1e9 * np.arange(n)).astype(np.int64)
    zero = np.zeros(3)
    count = len(problem.inertial.dt)
    factors = [
        preintegrate(samples, int(a), int(b), NOISE) for a, b in zip(ends[:count], ends[1:], strict=False)
    ]
    return replace(
        problem,
        initial=problem.initial.with_biases(zero, zero),
        inertial=InertialFactors.chain(factors, zero, zero),
        biases="estimated",
    )
