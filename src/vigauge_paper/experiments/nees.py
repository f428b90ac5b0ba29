"""Whether covariances are as large as the errors: NEES over Monte-Carlo trials, in every gauge.

Trials draw their noise anew. The likelihood ratio 2 (J(truth) - J(estimate)) is chi-square with n - 4
degrees of freedom, landmarks included. The motion block has 9N - 4 in a gauge that constrains the motion
alone, and the same NEES in all of them. The motion block of pinv(H) has 9N: its gauge is held by the
landmarks as well, so where the motion stands among them is four numbers more. What is broken on purpose
leaves the band, and its mended twin does not.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from vigauge.covariance.consistency import mean_nees_band, nees
from vigauge.covariance.covariance import Covariance
from vigauge.covariance.projection import along_orbit
from vigauge.gauge.gauges import CentroidGauge, FixedGauge, FreeGauge, KeyframeGauge
from vigauge.geometry.so3 import Array
from vigauge.model.evaluation import align_all_poses
from vigauge.model.factors import LinearFactor
from vigauge.model.imu import ImuNoise, ImuSamples, preintegrate
from vigauge.model.problem import InertialFactors, Problem
from vigauge.model.state import State
from vigauge.solver.levenberg_marquardt import Options, solve
from vigauge.solver.residuals import cost
from vigauge.synthetic.scenario import Scene, make_scene, make_trial, measured_imu

from ..ids import CONFIGURATIONS, Row
from .experiment import Experiment, Material

RIGHT = "as simulated"
HALVED, SIGMAS_RIGHT = "sigmas halved", "sigmas as drawn"
PRIOR_OFF, PRIOR_RIGHT = "wrong prior mean", "right prior mean"
SHARED, OWN = "shared samples", "unshared samples"
# What is broken on purpose, each beside the same without the fault.
BROKEN = {HALVED: SIGMAS_RIGHT, PRIOR_OFF: PRIOR_RIGHT, SHARED: OWN}

LIKELIHOOD, LAST, WITH_LANDMARKS = "likelihood ratio", "last keyframe", "free, landmarks"
# (dof, NEES) by gauge.
Nees = dict[str, tuple[int, float]]
# Streams of noise beside those of the simulator, which has 0, 1 and 2.
_PRIOR_STREAM = 3


@dataclass(frozen=True)
class Settings:
    """``trials`` of every configuration and case; ``confidence`` of the bands.

    Broken cases are done on the configuration of the sweep with ``landmarks`` only: ``sigma_factor`` on all
    sigmas, a prior that is ``prior_offset`` sigmas off, ``samples_per_factor`` of inertial data.
    """

    trials: int
    confidence: float
    landmarks: int
    sigma_factor: float
    prior_offset: float
    samples_per_factor: int


@dataclass(frozen=True)
class FreeMotionGauge(CentroidGauge):
    """Inner constraints of the motion: its covariance is the pseudo-inverse of the reduced camera system."""

    name: str = field(default="free", kw_only=True)

    def normal(self, state: State) -> Array:
        V = FreeGauge().normal(state).copy()
        V[9 * state.n_keyframes :] = 0.0
        return V


@dataclass(frozen=True)
class HeightPrior:
    """The last keyframe's height over the first, as a barometer has it: the same all along the orbit."""

    last: int
    height_m: float
    sigma_m: float

    @property
    def keyframes(self) -> tuple[int, ...]:
        return (0, self.last)

    def at(self, state: State, reference: State) -> LinearFactor:
        error = state.p_W[self.last, 2] - state.p_W[0, 2] - self.height_m
        columns = np.array([2, 3 * self.last + 2], dtype=np.int64)
        return LinearFactor(columns, np.array([error]) / self.sigma_m, np.array([[-1.0, 1.0]]) / self.sigma_m)


def nees_by_gauge(problem: Problem, truth: State, options: Options) -> Nees | None:
    """(dof, NEES) of a problem's minimum in every gauge, of the likelihood ratio and of the last keyframe in
    the fixed gauge; None where the run did not converge.

    It starts at the truth, which costs less and has the same minimum.
    """
    problem = problem.with_initial(truth)
    solution = solve(problem, FreeGauge(), options)
    if not solution.converged:
        return None
    # Near the truth on the orbit, the error's way to a gauge is the linear one of Eq. (14).
    state = align_all_poses(solution.state, truth)
    covariance = Covariance.of(problem, state)
    error, U, n_motion = state.local(truth), covariance.U, 9 * state.n_keyframes
    middle = KeyframeGauge(state.n_keyframes // 2)
    parts: dict[str, tuple[Array, Array, int]] = {}
    for gauge in (FixedGauge(), middle, CentroidGauge(), FreeMotionGauge(), FreeGauge(name=WITH_LANDMARKS)):
        V = gauge.normal(state)
        there = (error - along_orbit(U, V) @ (V.T @ error))[:n_motion]
        dof = n_motion - (0 if gauge.name == WITH_LANDMARKS else V.shape[1])
        parts[gauge.name] = there, covariance.motion(gauge), dof
    last = np.arange(n_motion).reshape(3, -1, 3)[:, -1].ravel()
    fixed = parts[FixedGauge().name]
    parts[LAST] = fixed[0][last], fixed[1][np.ix_(last, last)], len(last)
    ratio = truth.n_parameters - 4, 2.0 * (cost(problem, truth) - solution.cost)
    return {LIKELIHOOD: ratio, **{name: (part[2], nees(*part)) for name, part in parts.items()}}


def with_height_prior(problem: Problem, truth: State, sigma_m: float, sigmas_off: float) -> Problem:
    """A problem that knows the true height difference up to so many of its standard deviations."""
    last = truth.n_keyframes - 1
    height = float(truth.p_W[last, 2] - truth.p_W[0, 2]) + sigma_m * sigmas_off
    return replace(problem, factors=(HeightPrior(last, height, sigma_m),))


def inertial_factors(scene: Scene, trial: int, shared: bool) -> InertialFactors:
    """Inertial factors of a trial whose noise is all that is wrong with them.

    With few samples a factor the path between them is not known; what the exact samples lack against the
    truth is put back. ``shared``: a sample at a keyframe is in two factors, as everywhere; else every
    factor has samples drawn for it alone.
    """
    exact = _chain(scene, lambda factor: scene.imu)
    own = 1 + (trial + 1) * len(exact.dt)
    noisy = _chain(scene, lambda factor: measured_imu(scene, trial if shared else own + factor))
    p, R, v = scene.truth.p_W, scene.truth.R_WB, scene.truth.v_W
    to_body, dt = R[:-1].swapaxes(1, 2), exact.dt[:, None]
    fall = np.array([0.0, 0.0, -scene.settings.gravity_mps2]) * dt
    dv = np.einsum("fij,fj->fi", to_body, np.diff(v, axis=0) - fall)
    dp = np.einsum("fij,fj->fi", to_body, np.diff(p, axis=0) - (v[:-1] + 0.5 * fall) * dt)
    return replace(
        noisy,
        dp=dp + noisy.dp - exact.dp,
        dR=to_body @ R[1:] @ exact.dR.swapaxes(1, 2) @ noisy.dR,
        dv=dv + noisy.dv - exact.dv,
    )


def _chain(scene: Scene, samples: Callable[[int], ImuSamples]) -> InertialFactors:
    noise = ImuNoise(scene.settings.gyro_density, scene.settings.accel_density)
    ends = zip(scene.keyframe_ns[:-1], scene.keyframe_ns[1:], strict=True)
    return InertialFactors.chain(
        [preintegrate(samples(number), int(a), int(b), noise) for number, (a, b) in enumerate(ends)]
    )


def cases(scene: Scene, sparse: Scene, settings: Settings) -> Iterator[tuple[str, Problem, State]]:
    """Case, problem and truth of every trial of what is broken, and of its twins."""
    truth, s = scene.truth, scene.settings
    height = None
    for trial in range(settings.trials):
        problem = make_trial(scene, trial)
        yield SIGMAS_RIGHT, problem, truth
        yield HALVED, problem.with_noise(settings.sigma_factor * s.sigma_px, settings.sigma_factor), truth
        if height is None:
            # A prior as good as what is known without it.
            block = Covariance.of(problem, truth).motion(FixedGauge())
            height = float(np.sqrt(block[3 * s.n_keyframes - 1, 3 * s.n_keyframes - 1]))
        drawn = float(np.random.default_rng([s.seed, _PRIOR_STREAM, trial]).normal())
        for case, offset in ((PRIOR_RIGHT, 0.0), (PRIOR_OFF, settings.prior_offset)):
            yield case, with_height_prior(problem, truth, height, drawn + offset), truth
        images = make_trial(sparse, trial)
        for case in (OWN, SHARED):
            inertial = inertial_factors(sparse, trial, shared=case == SHARED)
            yield case, replace(images, inertial=inertial), sparse.truth


def summary(configuration: str, case: str, found: list[Nees], confidence: float) -> list[Row]:
    """A row a gauge: mean over the trials, and the band that it is in if the covariance is right."""
    rows: list[Row] = []
    for gauge in found[0] if found else ():
        dof = found[0][gauge][0]
        mean = float(np.mean([trial[gauge][1] for trial in found]))
        low, high = mean_nees_band(dof, len(found), confidence)
        rows.append(
            {
                "configuration": configuration,
                "case": case,
                "gauge": gauge,
                "trials": len(found),
                "dof": dof,
                "mean": mean,
                "low": low,
                "high": high,
                "inside": low <= mean <= high,
            }
        )
    return rows


def rows(material: Material, settings: Settings) -> list[Row]:
    """Every simulated configuration as it is; then what is broken, on the configuration of the sweep."""
    # At the minimum: where a run stops near it is no part of its covariance.
    options = replace(material.solver, function_tolerance=1e-12)
    simulation = replace(material.simulation, redraw_noise=True)
    out: list[Row] = []
    for number, name in enumerate(material.problems):
        scene = make_scene(*CONFIGURATIONS[name], simulation)
        # Trials of one number have the same noise in all configurations, so each has numbers of its own.
        numbers = range(number * settings.trials, (number + 1) * settings.trials)
        found = [nees_by_gauge(make_trial(scene, trial), scene.truth, options) for trial in numbers]
        out += summary(name, RIGHT, [one for one in found if one], settings.confidence)
    small = replace(simulation, n_landmarks=min(settings.landmarks, simulation.n_landmarks))
    rate = settings.samples_per_factor * (small.n_keyframes - 1) / small.duration_s
    scenes = [
        make_scene(*CONFIGURATIONS[material.sweep_configuration], s)
        for s in (small, replace(small, imu_rate_hz=rate))
    ]
    by_case: dict[str, list[Nees]] = {}
    for case, problem, truth in cases(scenes[0], scenes[1], settings):
        one = nees_by_gauge(problem, truth, options)
        if one:
            by_case.setdefault(case, []).append(one)
    for case, trials in by_case.items():
        out += summary(material.sweep_configuration, case, trials, settings.confidence)
    return out


EXPERIMENT = Experiment("nees", rows, Settings, reads=("problems",))
