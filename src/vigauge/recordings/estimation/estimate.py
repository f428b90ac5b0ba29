"""From a recording to its estimate: check, front-end, solve with biases, covariance. No truth is used."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...covariance.consistency import GroupChiSquare, chi_square
from ...covariance.covariance import Covariance
from ...errors import DataError, DegenerateError, SolverError
from ...gauge.gauges import FixedGauge, FreeGauge, Gauge, KeyframeGauge
from ...geometry.so3 import Array
from ...model.imu import ImuNoise
from ...model.loss import Loss
from ...model.problem import Problem
from ...model.state import State
from ...observability.diagnosis import Diagnosis, diagnose_equations
from ...solver.levenberg_marquardt import Solution
from ...solver.reintegration import solve_with_samples
from ..asl.sequence import Sequence, read_sequence
from ..checks.sequence import Window, check_sequence
from ..frontend.build import SIGMA_PX, build_problem
from ..frontend.report import FrontEndReport
from ..frontend.settings import FrontEndSettings
from .truth import TruthComparison, compare_with_truths
from .windows import Part, best, part_of, propose, tracking

_LOG = logging.getLogger("vigauge")
# Random walks of a MEMS sensor whose sensor.yaml has none: those that EuRoC states for its ADIS16448.
_USUAL_WALKS = {"gyro_walk": 1.9393e-5, "accel_walk": 3.0e-3}
# Chi-squares per redundancy outside of this band make sigmas wrong by more than a factor of 1.4.
CHI_SQUARE_BAND = (0.5, 2.0)
# The noise has been found where another round would change sigmas by less than 2 %.
_ROUNDS, _SETTLED = 8, 0.04
# Landmarks seen at less are left out. Of a stereo rig that turns on the spot only those within 3 m would pass
# the front-end's own bound; these few leave positions a hundred times as far off.
_PARALLAX_DEG = 0.5
# Motion that the gauge leaves open, in words.
_GAUGE = "position and heading of the whole are open: the gauge says where they count as known"


@dataclass(frozen=True)
class NoiseFit:
    """What the residuals say about the noise: pixel sigma, factor on all inertial densities.

    ``at_stated``: chi-squares per redundancy at one pixel and the stated densities; ``at_used``: at the noise
    that the covariance believes in.
    """

    sigma_px: float
    density_factor: float
    at_stated: GroupChiSquare
    at_used: GroupChiSquare


@dataclass(frozen=True)
class Estimate:
    """Result of :func:`estimate`, all of one window.

    Attributes
    ----------
    sequence : name of the recording
    part : its window
    t_ns : (N,) stamps of the keyframes by the inertial clock
    problem, solution : with biases in the state, inertial factors integrated at the biases found. W has z up,
        and the first keyframe near its origin
    gauge, gauge_name : of the covariance
    keyframes : (N, 15, 15) covariances of position, rotation, velocity, gyroscope and accelerometer bias, as
        :meth:`vigauge.Covariance.keyframes` gives them
    noise : what was believed, and what the residuals say of it
    diagnosis : what the measurements determine
    report : what the front-end did
    observable : sentences on what is and is not known
    warnings : sentences on what makes the result doubtful
    truths : comparisons with ground truths that happen to be there; nothing of them was used
    """

    sequence: str
    part: Part
    t_ns: NDArray[np.int64]
    problem: Problem
    solution: Solution
    gauge: Gauge
    gauge_name: str
    keyframes: Array
    noise: NoiseFit
    diagnosis: Diagnosis
    report: FrontEndReport
    observable: tuple[str, ...]
    warnings: tuple[str, ...]
    truths: tuple[TruthComparison, ...]

    @property
    def state(self) -> State:
        """The estimate."""
        return self.solution.state

    @property
    def biases(self) -> Array:
        """(N, 6) gyroscope bias, rad/s, then accelerometer bias, m/s^2."""
        assert self.state.gyro_bias is not None and self.state.accel_bias is not None
        return np.hstack([self.state.gyro_bias, self.state.accel_bias])

    @property
    def sigma(self) -> Array:
        """(N, 15) deviations in the gauge, in the order of ``keyframes``."""
        return np.sqrt(np.diagonal(self.keyframes, axis1=1, axis2=2))


def estimate(
    folder: Path | str,
    *,
    start_s: float | None = None,
    end_s: float | None = None,
    keyframes: int | None = None,
    gauge: Gauge | None = None,
    gauge_name: str = "first",
    loss: Loss | None = None,
    noise: str = "fitted",
    tracker: str | None = None,
    camera_time_offset_ns: int = 0,
    progress: bool = False,
) -> Estimate:
    """Motion, biases and their covariance from a recording in ASL layout, without a ground truth.

    Parameters
    ----------
    folder : contains ``mav0``
    start_s, end_s : the window, seconds after the first frame; where neither is given, the part of
        :func:`proposed_parts` that moves longest
    keyframes : their number; None: by the length of the window
    gauge, gauge_name : gauge of the covariance, and what to call it; the first pose by default
    loss : robust loss of reprojection errors; None: squares
    noise : "fitted": pixel sigma and a factor on the inertial densities, so that chi-squares per
        redundancy are one, but not below the stated densities; "stated": one pixel and the densities of
        ``imu0/sensor.yaml``
    tracker : "optical_flow" or "descriptors", as the front-end's setting; None: flow where frames are dense
    camera_time_offset_ns : added to stamps of frames to get the clock of the inertial sensor
    progress : show a bar on standard error, where that is a terminal

    Raises
    ------
    DataError
        where the recording cannot be used, with the reason and what would do.
    SolverError
        where alignment or solving fail; its subclass DegenerateError where more than the gauge is
        unobservable, so that no covariance would mean anything.
    """
    if noise not in ("fitted", "stated"):
        raise DataError("noise", "must be 'fitted' or 'stated'", value=noise)
    sequence = read_sequence(Path(folder))
    if start_s is None and end_s is None:
        parts = propose(sequence, camera_time_offset_ns)
        part = best(parts)
        if len(parts) > 1:
            _LOG.info("%s has %d parts: the one that moves longest is used", sequence.name, len(parts))
    else:
        end = float("inf") if end_s is None else end_s
        part = part_of(sequence, start_s or 0.0, end, camera_time_offset_ns)
    tracker, count = tracking(sequence, part, keyframes, tracker)
    if isinstance(gauge, KeyframeGauge) and not 0 <= gauge.index < count:
        raise DataError("gauge", f"must be a keyframe from 0 to {count - 1}", value=gauge.index)
    warnings = list(_checked(sequence, part, camera_time_offset_ns))
    sequence, more = _with_walks(sequence)
    _LOG.info("%s: window %s, %d keyframes of %d frames", sequence.name, part, count, part.frames)
    settings = front_end_settings(sequence, part, tracker, count, camera_time_offset_ns)
    problem, t_ns, report = build_problem(sequence, None, settings, progress=progress)
    solve = _Solve(sequence, t_ns)
    fit, problem, solution = _fit_noise(solve, problem, noise)
    if loss is not None:
        problem, solution = solve.at(
            replace(problem, loss=loss).with_initial(solution.state), fit.density_factor
        )
    covariance = Covariance.of(problem, solution.state)
    diagnosis = diagnose_equations(covariance.equations, problem, solution.state)
    if diagnosis.withheld:
        raise DegenerateError(f"{sequence.name}, {part}: no covariance is given: {diagnosis.withheld}")
    gauge = FixedGauge() if gauge is None else gauge
    return Estimate(
        sequence=sequence.name,
        part=part,
        t_ns=t_ns,
        problem=problem,
        solution=solution,
        gauge=gauge,
        gauge_name=gauge_name,
        keyframes=covariance.keyframes(gauge),
        noise=fit,
        diagnosis=diagnosis,
        report=report,
        observable=(diagnosis.sentence, _GAUGE, *report.aligned.get("remarks", ())),
        warnings=(*warnings, *more, *_doubts(fit)),
        truths=tuple(compare_with_truths(sequence, solution.state, t_ns)),
    )


def proposed_parts(folder: Path | str, camera_time_offset_ns: int = 0) -> list[Part]:
    """The parts of a recording that can be estimated one by one, in order of time.

    Raises DataError where there is none, and as :func:`.asl.sequence.read_sequence`.
    """
    return propose(read_sequence(Path(folder)), camera_time_offset_ns)


def _checked(sequence: Sequence, part: Part, offset_ns: int) -> list[str]:
    """Warnings of the check of the window; DataError with what it calls unusable."""
    window = Window(int(sequence.frames.t_ns[0]), part.start_s, part.end_s)
    found = check_sequence(sequence.folder, [], window, offset_ns)
    errors = [finding.message for finding in found.of("error")]
    if errors:
        more = f" (and {len(errors) - 1} more: see `vigauge check`)" if len(errors) > 1 else ""
        raise DataError(sequence.folder, f"{part}: {errors[0]}{more}")
    return [finding.message for finding in found.of("warning")]


def _with_walks(sequence: Sequence) -> tuple[Sequence, list[str]]:
    """Estimated biases need a random walk of both; where none is stated, a usual one is taken."""
    missing = {name: walk for name, walk in _USUAL_WALKS.items() if not getattr(sequence.imu_noise, name)}
    if not missing:
        return sequence, []
    text = ", ".join(f"{name} {walk:g}" for name, walk in missing.items())
    warning = f"imu0/sensor.yaml states no random walk of the biases; a usual one is taken: {text}"
    return replace(sequence, imu_noise=replace(sequence.imu_noise, **missing)), [warning]


def front_end_settings(
    sequence: Sequence, part: Part, tracker: str, keyframes: int, offset_ns: int = 0
) -> FrontEndSettings:
    """Settings with which :func:`estimate` looks at a part."""
    return FrontEndSettings.from_mapping(
        {
            "tracker": tracker,
            "biases": "estimated",
            "optical_flow": {"patch": "affine"},
            "triangulation": {"parallax_deg": _PARALLAX_DEG},
            "camera_time_offset_ns": offset_ns,
            "keyframes": {
                "window_origin_ns": int(sequence.frames.t_ns[0]),
                "window_start_s": part.start_s,
                "window_end_s": part.end_s,
                "count": keyframes,
            },
        },
        "estimate",
    )


@dataclass(frozen=True)
class _Solve:
    """Solving with the samples of a sequence at hand."""

    sequence: Sequence
    t_ns: NDArray[np.int64]

    def at(self, problem: Problem, density_factor: float) -> tuple[Problem, Solution]:
        noise: ImuNoise = self.sequence.imu_noise.scaled(density_factor)
        problem, solution = solve_with_samples(problem, FreeGauge(), self.sequence.imu, self.t_ns, noise)
        if not solution.converged:
            rule = "ended without a minimum; another window or more keyframes may do"
            raise SolverError(f"{self.sequence.name}: solving {rule} ({solution.status})")
        return problem, solution


def _fit_noise(solve: _Solve, stated: Problem, noise: str) -> tuple[NoiseFit, Problem, Solution]:
    """Solve at the stated noise, then, if asked to, scale both kinds until their chi-squares are one.

    These are variance components: a group's chi-square per redundancy estimates the factor on its variance.
    Inertial noise is not taken below what its sensor states: few residuals tell it, and steady biases shrink
    them.
    """
    problem, solution = solve.at(stated, 1.0)
    first = found = chi_square(problem, solution.state)
    sigma_px, factor = SIGMA_PX, 1.0
    for _ in range(_ROUNDS if noise == "fitted" else 0):
        larger = max(factor * float(np.sqrt(found.inertial)), 1.0)
        if max(abs(found.visual - 1.0), abs((larger / factor) ** 2 - 1.0)) < _SETTLED:
            break
        sigma_px, factor = sigma_px * float(np.sqrt(found.visual)), larger
        problem, solution = solve.at(stated.with_noise(sigma_px, factor).with_initial(solution.state), factor)
        found = chi_square(problem, solution.state)
    return NoiseFit(sigma_px, factor, first, found), problem, solution


def _doubts(fit: NoiseFit) -> list[str]:
    """Sentences on chi-squares that say that sigmas cannot be trusted."""
    used, low = fit.at_used, CHI_SQUARE_BAND[0]
    out = []
    for kind, value, redundancy in (
        ("image", used.visual, used.visual_redundancy),
        ("inertial", used.inertial, used.inertial_redundancy),
    ):
        high = _largest(redundancy)
        # Small inertial residuals make sigmas too large, which is no harm; few of them often are small.
        if value > high or (kind == "image" and value < low):
            out.append(
                f"sigmas cannot be trusted: the chi-square of the {kind} residuals is {value:.2g} per "
                f"redundancy, outside {low:g} to {high:.2g}: the noise is {np.sqrt(value):.2g} times what is "
                "believed; --noise fitted scales it"
            )
    if fit.density_factor > 1.0 and fit.at_stated.inertial > _largest(fit.at_stated.inertial_redundancy):
        out.append(
            f"inertial residuals ask for densities {fit.density_factor:.2g} times those of imu0/sensor.yaml, "
            "and sigmas count them as noise: vibration, clocks or calibration may be the cause, whose errors "
            "do not average out, so true errors can be several sigmas"
        )
    return out


def _largest(redundancy: float) -> float:
    """Largest chi-square per redundancy that noise gives, by three of its own sigmas, and the band."""
    return max(CHI_SQUARE_BAND[1], 1.0 + 3.0 * float(np.sqrt(2.0 / redundancy)))
