"""From a sequence to a problem: tracking, poses, gravity, landmarks, inertial factors.

Ground truth gives the biases and nothing else, or nothing at all (``biases``: aligned or estimated). The
start that comes out is the front-end's own: PnP poses, velocities and gravity by alignment, of one camera the
scale too, triangulated landmarks. Solving serves here only to find outliers; its estimate is thrown away.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from collections.abc import Sequence as SequenceOf
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from ...errors import DataError, VigaugeError
from ...geometry.camera import EQUIDISTANT, Camera, ideal_size
from ...geometry.so3 import Array
from ...model.factors import BiasPrior
from ...model.imu import ImuSamples
from ...model.problem import InertialFactors, Problem
from ...model.state import State
from ..alignment import Alignment, align
from ..asl.ground_truth import GroundTruth
from ..asl.images import read_image
from ..asl.sequence import Sequence
from .descriptor_matching import track_by_descriptors
from .frames import choose_frames
from .inertial import (
    ANY_GAP_S,
    Biases,
    ConstantBiases,
    KnownBiases,
    check_gaps,
    inertial_factors,
    preintegrate_between,
)
from .initialisation import GravityAlignment, align_with_gravity
from .mapping import Map, pose_keyframes
from .monocular import pose_up_to_scale
from .opencv import one_thread
from .optical_flow import track_by_flow
from .outliers import Inliers, find_inliers
from .report import FrontEndReport
from .settings import FrontEndSettings
from .stereo import Image, StereoGeometry
from .tracks import LEFT, RIGHT, TrackingCounts, Tracks
from .triangulation import Triangulation, triangulate

# No gyroscope is off by more.
_GYRO_BIAS_SIGMA_RADPS = 1.0
# The problem is built with the noise as published; who uses it says what to believe
# (``Problem.with_noise``).
SIGMA_PX = 1.0
# What a known accelerometer bias, which wanders, may still be off by over a window.
_KNOWN_BIAS_SIGMA_MPS2 = 0.01
# Good recordings leave 0.5 to 7 mm between poses and inertial samples, and a force of the wrong sign 0.1 m or
# more, a hundred times what the right one leaves.
_PLAUSIBLE_MISFIT_M, _TIMES_BETTER = 0.02, 5.0


@dataclass(frozen=True)
class _Start:
    """The front-end's start in the world frame W: upright, first keyframe at the origin.

    ``biases`` : those to start from where the problem estimates them, and the ``prior`` of the first ones
    """

    p_W: Array
    R_WB: Array
    v_W: Array
    biases: ConstantBiases | None = None
    prior: tuple[BiasPrior, ...] = ()


def build_problem(
    sequence: Sequence, biases: GroundTruth | None, settings: FrontEndSettings, *, progress: bool = False
) -> tuple[Problem, NDArray[np.int64], FrontEndReport]:
    """The problem of a sequence, the stamps of its keyframes (N,) in ns, and what was done.

    The problem's world frame has z up, the first keyframe at its origin and an arbitrary
    yaw; its noise is one pixel and the sequence's published densities.

    Parameters
    ----------
    biases : ground truth to take known biases from, and nothing else; not used, and may be None, where
        ``settings.biases`` is "aligned" or "estimated"
    progress : show a bar on standard error, where that is a terminal

    Raises DataError for input that cannot be used: too few frames, points or inliers, inertial samples or
    biases that do not cover the window, a frozen camera, a broken image, no truth where biases are to come
    from it. VigaugeError where alignment or the outlier rounds fail.
    """
    sequence, keyframes, skipped = choose_frames(sequence, settings)
    t_ns = sequence.frames.t_ns[keyframes]
    check_gaps(sequence.imu, int(t_ns[0]), int(t_ns[-1]), settings.largest_imu_gap_s)
    known = _known_biases(biases, settings, int(t_ns[0]))
    with one_thread():
        tracks, counts = _track(sequence, keyframes, known, settings, progress)
        mapped = _map(sequence.cameras, tracks, len(keyframes), settings)
    alignment: Alignment | GravityAlignment
    estimated = None
    if isinstance(known, KnownBiases) and len(sequence.cameras) == 2:
        factors = inertial_factors(sequence.imu, sequence.imu_noise, t_ns, known)
        alignment = align_with_gravity(mapped.p_M, mapped.R_MB, factors, settings.gravity_mps2)
    else:
        alignment = _align(sequence, t_ns, mapped, settings, known)
        mapped = _metric(mapped, sequence.cameras, alignment.scale)
        if not isinstance(known, KnownBiases):
            known = ConstantBiases(alignment.gyro_bias, alignment.accel_bias)
            estimated = known if settings.biases == "estimated" else None
        factors = inertial_factors(sequence.imu, sequence.imu_noise, t_ns, known, estimated)
    start = _upright(mapped, alignment, estimated, settings.accel_bias_sigma_mps2)

    first = triangulate(sequence.cameras, start.p_W, start.R_WB, mapped.tracks, settings.triangulation)
    candidate = _problem(sequence.cameras, start, mapped.tracks, first, factors, settings.gravity_mps2)
    inliers = find_inliers(candidate, settings.outliers, settings.triangulation.keyframes)
    clean = _tracks_of(candidate).where(inliers.observation)
    final = triangulate(sequence.cameras, start.p_W, start.R_WB, clean, settings.triangulation)
    problem = _problem(sequence.cameras, start, clean, final, factors, settings.gravity_mps2)
    window = keyframes[-1] - keyframes[0] + 1
    report = _report(
        sequence,
        settings,
        int(window),
        tracks,
        counts,
        mapped,
        alignment,
        first,
        candidate,
        inliers,
        problem,
        skipped,
    )
    return problem, t_ns, report


def _known_biases(truth: GroundTruth | None, settings: FrontEndSettings, first_ns: int) -> Biases:
    """Biases to follow points by: those of the truth, or none yet where alignment is to find them."""
    if settings.biases in ("aligned", "estimated"):
        return ConstantBiases(np.zeros(3), np.zeros(3))
    if truth is None:
        rule = 'must be "aligned" or "estimated" where there is no ground truth to take biases from'
        raise DataError("front-end settings", rule, field="biases", value=settings.biases)
    return KnownBiases(truth, settings.biases, first_ns)


def _map(cameras: tuple[Camera, ...], tracks: Tracks, n_keyframes: int, settings: FrontEndSettings) -> Map:
    """Poses of the keyframes by sight alone; of one camera, those of the camera and up to scale."""
    if len(cameras) == 2:
        return pose_keyframes(cameras, tracks, n_keyframes, settings.pose, settings.triangulation)
    rules = settings.pose, settings.triangulation, settings.outliers
    return pose_up_to_scale(cameras[LEFT], tracks, n_keyframes, *rules)


def _metric(mapped: Map, cameras: tuple[Camera, ...], scale: float) -> Map:
    """The map in metres, its poses those of the body: a map up to scale has the camera's."""
    if len(cameras) == 2:
        return mapped
    p_M = scale * mapped.p_M - mapped.R_MB @ cameras[LEFT].p_BC
    return replace(mapped, p_M=p_M - p_M[0])


def _align(
    sequence: Sequence, t_ns: NDArray[np.int64], mapped: Map, settings: FrontEndSettings, biases: Biases
) -> Alignment:
    """Gravity, motion, biases and, of one camera, scale, at the noise that the outlier rounds believe in."""
    known = isinstance(biases, KnownBiases)
    alone = len(sequence.cameras) == 1

    def aligned(samples: ImuSamples) -> Alignment:
        return align(
            mapped.p_M,
            mapped.R_MB,
            samples,
            t_ns,
            sequence.imu_noise.scaled(settings.outliers.density_factor),
            settings.gravity_mps2,
            p_B=sequence.cameras[LEFT].p_BC if alone else np.zeros(3),
            scale=alone,
            accel_bias_sigma=_KNOWN_BIAS_SIGMA_MPS2 if known else settings.accel_bias_sigma_mps2,
            largest_gap_s=ANY_GAP_S,
        )

    samples = sequence.imu.corrected(*biases.between(int(t_ns[0]), int(t_ns[-1])))
    found = aligned(samples)
    if found.rms_position_m > _PLAUSIBLE_MISFIT_M and not alone:
        _require_upward_force(sequence, found, aligned, samples)
    return found


def _require_upward_force(
    sequence: Sequence, found: Alignment, aligned: Callable[[ImuSamples], Alignment], samples: ImuSamples
) -> None:
    """Refuse forces of the wrong sign, which would turn the world upside down."""
    try:
        opposite = aligned(replace(samples, accel=-samples.accel)).rms_position_m
    except VigaugeError:  # the opposite sign does not fit at all
        return
    times = found.rms_position_m / opposite
    if times > _TIMES_BETTER:
        fits = f"the opposite sign fits the camera's motion {times:.0f} times better"
        raise DataError(
            sequence.folder / "mav0" / "imu0" / "data.csv", f"must be +9.8 upwards at rest: {fits}", field="a"
        )


def _track(
    sequence: Sequence,
    keyframes: NDArray[np.int64],
    biases: Biases,
    settings: FrontEndSettings,
    progress: bool,
) -> tuple[Tracks, TrackingCounts]:
    """Tracks over the keyframes by the tracker that the settings name."""
    geometry = StereoGeometry.of(sequence.cameras)
    paths = (sequence.frames.left, sequence.frames.right)

    def read(frame: int, camera: int) -> Image:
        return read_image(paths[camera][frame], sequence.cameras[camera])

    if settings.tracker == "descriptors":
        bar = _bar(keyframes.tolist(), f"{sequence.name}: matching keyframes", progress)
        return track_by_descriptors(read, bar, geometry, settings.descriptors, settings.stereo, settings.pose)
    frames = range(int(keyframes[0]), int(keyframes[-1]) + 1)
    steps = preintegrate_between(sequence.imu, sequence.imu_noise, sequence.frames.t_ns[list(frames)], biases)
    dR_B = np.array([step.dR for step in steps]).reshape(-1, 3, 3)
    bar = _bar(frames, f"{sequence.name}: following points", progress)
    return track_by_flow(read, bar, keyframes, dR_B, geometry, settings.optical_flow, settings.stereo)


def _bar(items: SequenceOf[int], label: str, progress: bool) -> Collection[int]:
    bar: Any = tqdm(items, desc=label, unit="frame", disable=None if progress else True)
    return bar


def _upright(
    mapped: Map,
    alignment: Alignment | GravityAlignment,
    biases: ConstantBiases | None,
    accel_bias_sigma: float,
) -> _Start:
    R_WM, zero = alignment.R_WM, np.zeros(3)
    # The alignment has seen the data that the problem has, so the prior is what was known before.
    prior = (BiasPrior(0, zero, zero, _GYRO_BIAS_SIGMA_RADPS, accel_bias_sigma),) if biases else ()
    return _Start(mapped.p_M @ R_WM.T, R_WM @ mapped.R_MB, alignment.v_M @ R_WM.T, biases, prior)


def _problem(
    cameras: tuple[Camera, ...],
    start: _Start,
    tracks: Tracks,
    triangulation: Triangulation,
    factors: InertialFactors,
    gravity: float,
) -> Problem:
    """The problem of the tracks that could be triangulated, from the observations used for that."""
    if not np.any(triangulation.good):
        counts = ", ".join(f"{n} {reason}" for reason, n in triangulation.rejected().items())
        raise DataError("front-end", f"some landmark must pass the checks (refused: {counts})", value=0)
    kept = tracks.where(triangulation.used).renumbered(triangulation.good)
    initial = State.start(start.p_W, start.R_WB, start.v_W, triangulation.points_W[triangulation.good])
    return Problem.from_observations(
        initial=initial.with_biases(start.biases.gyro, start.biases.accel) if start.biases else initial,
        cameras=cameras,
        keyframe=kept.keyframe,
        camera=kept.camera,
        landmark=kept.track,
        uv=kept.uv,
        sigma_px=SIGMA_PX,
        inertial=factors,
        gravity=gravity,
        obs_noise=_noise_of(cameras, kept),
        factors=start.prior,
        biases="estimated" if start.biases else "known",
    )


def _noise_of(cameras: tuple[Camera, ...], tracks: Tracks) -> Array | None:
    """(M,) factor on the noise of each observation; None where no lens is a fisheye."""
    if all(camera.lens != EQUIDISTANT for camera in cameras):
        return None
    by_camera = [ideal_size(camera, tracks.uv) for camera in cameras]
    return np.where(tracks.camera == RIGHT, by_camera[-1], by_camera[LEFT])


def _tracks_of(problem: Problem) -> Tracks:
    return Tracks(
        problem.obs_keyframe,
        problem.obs_camera,
        problem.obs_landmark,
        problem.obs_uv,
        problem.initial.n_landmarks,
    )


def _report(
    sequence: Sequence,
    settings: FrontEndSettings,
    window: int,
    tracks: Tracks,
    counts: TrackingCounts,
    mapped: Map,
    alignment: Alignment | GravityAlignment,
    first: Triangulation,
    candidate: Problem,
    inliers: Inliers,
    problem: Problem,
    skipped: dict[str, int],
) -> FrontEndReport:
    rejected = first.rejected()
    return FrontEndReport(
        sequence=sequence.name,
        tracker=settings.tracker,
        frames=window,
        keyframes=problem.initial.n_keyframes,
        tracks=tracks.n_tracks,
        landmarks=problem.initial.n_landmarks,
        observations=len(problem.obs_uv),
        observations_right=int(np.count_nonzero(problem.obs_camera == RIGHT)),
        tracks_per_keyframe=_tracks_of(problem).tracks_per_keyframe(problem.initial.n_keyframes).tolist(),
        stereo_tried=counts.stereo_tried,
        stereo_matched=counts.stereo_matched,
        tracking_lost=dict(counts.lost),
        pnp_tried=mapped.tried.tolist(),
        pnp_inliers=mapped.inliers.tolist(),
        pnp_refused_observations=mapped.n_refused,
        triangulation_rejected=rejected,
        rejected_share={reason: n / max(tracks.n_tracks, 1) for reason, n in rejected.items()},
        outlier_observations=int(np.count_nonzero(~inliers.observation)),
        outlier_landmarks=candidate.initial.n_landmarks - problem.initial.n_landmarks,
        outlier_rounds=inliers.rounds,
        median_reprojection_start_px=float(np.median(inliers.error_before_px)),
        median_reprojection_end_px=float(np.median(inliers.error_after_px)),
        free_gravity_mps2=alignment.free_gravity,
        alignment_rms_position_m=alignment.rms_position_m,
        alignment_rms_velocity_mps=alignment.rms_velocity_mps,
        image_pairs_without_right=len(sequence.frames.dropped_ns),
        frames_skipped=skipped,
        aligned=alignment.to_mapping() if isinstance(alignment, Alignment) else {},
    )
