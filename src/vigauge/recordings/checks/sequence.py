"""All checks on one ASL folder: what it is, and what is wrong with it, before anything is solved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ...errors import DataError, VigaugeError
from ...geometry.camera import Camera
from ...geometry.so3 import Array
from ...model.imu import ImuNoise, ImuSamples
from ..asl.calibration import read_camera, read_imu_noise, read_sensor_yaml
from ..asl.ground_truth import read_ground_truth, truth_folders
from ..asl.sequence import Sequence, StereoFrames, camera_names, read_frames, read_imu
from ..frontend.opencv import one_thread
from ..frontend.tracks import LEFT
from .findings import Findings
from .inertial import check_gravity, check_noise, find_rest
from .rig import check_calibration, check_frozen, check_motion, check_stereo
from .samples import check_samples
from .spacing import check_spacing
from .stamps import CAMERA_RATE_HZ, IMU_RATE_HZ, check_coverage, check_partners, check_rate
from .truth import check_truth
from .turning import GyroRotation, Turns
from .vision import Effort, ImageSample, find_frozen

# Inertial samples kept on both sides of the frames, for clocks that differ.
_MARGIN_NS = 1_000_000_000
_T = TypeVar("_T")


@dataclass(frozen=True)
class Window:
    """The part of a recording that is looked at: seconds after ``origin_ns`` (0: after the first frame)."""

    origin_ns: int = 0
    start_s: float = 0.0
    end_s: float = float("inf")


@dataclass(frozen=True)
class _Parts:
    """What could be read of a folder; None where it could not."""

    cameras: tuple[Camera | None, ...]
    noise: ImuNoise | None
    imu: ImuSamples | None
    frames: StereoFrames | None


def check_sequence(
    folder: Path,
    truths: list[str] | None = None,
    window: Window | None = None,
    camera_time_offset_ns: int = 0,
    effort: Effort | None = None,
    *,
    sort: bool = False,
) -> Findings:
    """Check an ASL folder; bad data become findings, never exceptions.

    Parameters
    ----------
    truths : names of the ground-truth folders to check, which must be there; None: all there are
    window : part of the recording; None: all of it
    camera_time_offset_ns : added to the stamps of frames, as the front-end's setting of that name
    effort : how many images to look at; None: as many as take some seconds
    sort : rows out of order are a warning and sorted, as where sequences are read
    """
    folder = Path(folder)
    out = Findings(folder.resolve().name)
    mav = folder / "mav0"
    if not mav.is_dir():
        out.error("files", str(DataError(mav, "sequence folder must exist and contain mav0")))
        return out
    if not any((mav / camera).exists() for camera in ("cam0", "cam1")):
        _check_without_images(mav, truths, window or Window(), sort, out)
        return out
    parts = _read_parts(mav, sort, out)
    inertial = _check_stamps(mav, parts, window or Window(), camera_time_offset_ns, out)
    if inertial is not None:
        _check_contents(folder, mav, parts, *inertial, truths, effort or Effort(), sort, out)
    return out


def _check_without_images(
    mav: Path, truths: list[str] | None, window: Window, sort: bool, out: Findings
) -> None:
    """Inertial sensor and truths of a folder without cameras; its window counts from the first sample."""
    for check in ("calibration of the cameras", "images", "motion"):
        out.skip(
            check, "there is neither cam0 nor cam1: the inertial sensor and the truths alone are checked"
        )
    imu = _read_imu(mav, sort, out)[1]
    if imu is None or not check_rate("imu0", imu.t_ns, IMU_RATE_HZ, _stated_rate(mav), out):
        return
    seconds = (imu.t_ns - (window.origin_ns or int(imu.t_ns[0]))) * 1e-9
    inside = (seconds >= window.start_s) & (seconds <= window.end_s)
    if np.count_nonzero(inside) < 2:
        text = f"window {window.start_s:g}..{window.end_s:g} s; 2 are needed"
        out.error("window", f"{np.count_nonzero(inside)} samples of imu0 lie in the {text}")
        return
    imu = ImuSamples(imu.t_ns[inside], imu.gyro[inside], imu.accel[inside])
    check_samples(imu, int(imu.t_ns[0]), int(imu.t_ns[-1]), out)
    _check_motion_and_truths(mav, imu, np.empty(0, dtype=np.int64), None, truths, sort, out)


def _try(out: Findings, check: str, read: Callable[[], _T]) -> _T | None:
    """The result of a reader, or None and an error that says what is wrong."""
    try:
        return read()
    except VigaugeError as error:
        out.error(check, str(error))
        return None


def _warn_of_order(check: str, rows: int, out: Findings) -> None:
    if rows:
        out.warn(check, f"{rows} row(s) were out of order and have been sorted")


def _read_imu(mav: Path, sort: bool, out: Findings) -> tuple[ImuNoise | None, ImuSamples | None]:
    noise = _try(out, "calibration", partial(read_imu_noise, mav / "imu0" / "sensor.yaml"))
    imu = _try(out, "imu0", partial(read_imu, mav / "imu0" / "data.csv", sort))
    if noise is not None:
        out.fact("imu0", gyro_density=noise.gyro_density, accel_density=noise.accel_density)
    if imu is not None:
        repeated = imu[1].n_repeated
        out.fact("imu0", repeated_rows=repeated)
        if repeated:
            out.warn("imu0", f"imu0 repeats {repeated} identical row(s), which are left out")
        _warn_of_order("imu0", imu[1].n_unsorted, out)
    return noise, imu[0] if imu else None


def _read_parts(mav: Path, sort: bool, out: Findings) -> _Parts:
    cameras = tuple(
        _try(out, "calibration", partial(read_camera, mav / name / "sensor.yaml"))
        for name in camera_names(mav)
    )
    noise, imu = _read_imu(mav, sort, out)
    frames = _try(out, "frames", partial(read_frames, mav, sort))
    if frames is not None:
        _warn_of_order("frames", frames.n_unsorted, out)
    known = tuple(camera for camera in cameras if camera is not None)
    if known == cameras:
        check_calibration(known, out)
    return _Parts(cameras, noise, imu, frames)


def _check_stamps(
    mav: Path, parts: _Parts, window: Window, offset_ns: int, out: Findings
) -> tuple[ImuSamples, StereoFrames, NDArray[np.int64], int] | None:
    """Stamps of all sensors; then samples and frames by one clock, the frames of the window, its origin.

    None where they do not allow any further check.
    """
    if parts.imu is None or parts.frames is None:
        for check in ("stamps", "images", "motion"):
            out.skip(check, "needs both imu0 and the frames")
        return None
    check_rate("imu0", parts.imu.t_ns, IMU_RATE_HZ, _stated_rate(mav), out)
    frames = replace(
        parts.frames, t_ns=parts.frames.t_ns + offset_ns, dropped_ns=parts.frames.dropped_ns + offset_ns
    )
    origin_ns = window.origin_ns or int(parts.frames.t_ns[0])
    seconds = (parts.frames.t_ns - origin_ns) * 1e-9
    inside = np.flatnonzero((seconds >= window.start_s) & (seconds <= window.end_s))
    if len(inside) < 2:
        out.error(
            "window",
            f"{len(inside)} frames lie in the window {window.start_s:g}..{window.end_s:g} s; 2 are needed",
        )
        return None
    stamps = frames.t_ns[inside]
    first, last = int(stamps[0]), int(stamps[-1])
    check_rate("cam0", stamps, CAMERA_RATE_HZ, None, out)
    check_partners(frames, first, last, out)
    check_coverage("imu0", parts.imu.t_ns, stamps, out)
    if any(finding.check in ("rate", "coverage") for finding in out.of("error")):
        for check in ("imu gaps", "images", "motion"):
            out.skip(check, "the stamps are wrong")
        return None
    check_samples(parts.imu, first, last, out)
    near = (parts.imu.t_ns >= first - _MARGIN_NS) & (parts.imu.t_ns <= last + _MARGIN_NS)
    imu = ImuSamples(parts.imu.t_ns[near], parts.imu.gyro[near], parts.imu.accel[near])
    return imu, frames, inside, origin_ns + offset_ns


def _stated_rate(mav: Path) -> object:
    """``rate_hz`` of the inertial sensor's sensor.yaml; None where it cannot be read."""
    try:
        return read_sensor_yaml(mav / "imu0" / "sensor.yaml").get("rate_hz")
    except DataError:
        return None  # reported where the calibration was read


def _check_contents(
    folder: Path,
    mav: Path,
    parts: _Parts,
    imu: ImuSamples,
    frames: StereoFrames,
    inside: NDArray[np.int64],
    origin_ns: int,
    truths: list[str] | None,
    effort: Effort,
    sort: bool,
    out: Findings,
) -> None:
    """Images, motion, gravity, truths."""
    gyro, rest = GyroRotation(imu), find_rest(imu)
    if parts.noise is not None:
        check_noise(parts.noise, imu, out)
    fit = None
    cameras = tuple(camera for camera in parts.cameras if camera is not None)
    if cameras != parts.cameras or parts.noise is None:
        for check in ("images", "camera against gyro"):
            out.skip(check, "the calibration could not be read")
    else:
        sequence = Sequence(out.sequence, folder, cameras, frames, imu, parts.noise)
        check_spacing(frames.t_ns[inside], cameras[LEFT], gyro, out)
        sample = ImageSample(sequence, _without_frozen(sequence, inside, out), effort)
        with one_thread():
            seen = _check_images(sample, out)
        if seen is not None:
            fit = check_motion(*seen, gyro, rest, origin_ns, out)
    _check_motion_and_truths(
        mav, imu, frames.t_ns[inside], fit.gyro_bias if fit is not None else None, truths, sort, out
    )


def _without_frozen(sequence: Sequence, inside: NDArray[np.int64], out: Findings) -> NDArray[np.int64]:
    """The frames whose left image is not the one before; those that are are findings, right ones too."""
    frozen = [find_frozen(sequence, inside, camera) for camera in range(len(sequence.cameras))]
    for name, its in zip(("cam0", "cam1"), frozen, strict=False):
        check_frozen(name, sequence.frames.t_ns[its].tolist(), out)
    return np.setdiff1d(inside, frozen[LEFT])


def _check_images(sample: ImageSample, out: Findings) -> tuple[Turns, Array, int] | None:
    """Stereo geometry; and the turns of the camera, where images and calibration allow poses."""
    stereo = _try(out, "images", sample.stereo)
    if stereo is not None:
        check_stereo(stereo, sample.explain_epipolar, out)
    if any(f.check in ("images", "stereo", "extrinsics", "baseline") for f in out.of("error")):
        out.skip("camera against gyro", "images or calibration do not allow poses")
        return None
    return _try(out, "images", sample.turns)


def _check_motion_and_truths(
    mav: Path,
    imu: ImuSamples,
    frames_ns: NDArray[np.int64],
    gyro_bias: Array | None,
    truths: list[str] | None,
    sort: bool,
    out: Findings,
) -> None:
    """Gravity and truths; ``gyro_bias`` is what the camera says, or None."""
    rest = find_rest(imu)
    bias = gyro_bias if gyro_bias is not None else rest.gyro_bias
    check_gravity(imu, rest, bias if bias is not None else imu.gyro.mean(axis=0), out)
    names = truths if truths is not None else truth_folders(mav)
    if not names:
        out.skip("truth", "there is neither a state_groundtruth_* folder nor mocap0")
    for name in names:
        truth = _try(out, f"truth {name}", partial(read_ground_truth, mav / name, sort=sort))
        if truth is not None:
            _warn_of_order(f"truth {name}", truth.n_unsorted, out)
            check_truth(name, truth, imu, frames_ns, bias, out)
