"""A visual-inertial sequence in ASL layout: ``mav0/{cam0,cam1,imu0}``, cam1 or not; checked as it is read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path, PureWindowsPath

import numpy as np
from numpy.typing import NDArray

from ...errors import DataError
from ...geometry.camera import Camera
from ...model.imu import ImuNoise, ImuSamples
from .calibration import read_camera, read_imu_noise
from .nearest import nearest_index
from .tables import FASTEST_SAMPLES_NS, Table, read_table

# The two cameras are triggered together; their stamps may differ by rounding only.
STEREO_TOLERANCE_NS = 10_000
_LEAST_BASELINE_M = 1e-3
# No rotor vehicle leaves these on the median; other units or swapped columns do.
_MEDIAN_FORCE_MPS2 = (4.0, 25.0)
# Above the 2000 deg/s that such gyroscopes saturate at.
_LARGEST_RATE_RADPS = 40.0


@dataclass(frozen=True)
class StereoFrames:
    """Image files of both cameras, or of the one that there is."""

    t_ns: NDArray[np.int64]  # (F,) int64 stamps of the left camera, strictly increasing
    # F paths each; ``right`` is empty where there is one camera.
    left: tuple[Path, ...]
    right: tuple[Path, ...]
    # (D,) int64 stamps of left frames without a right one, which are not in the lists.
    dropped_ns: NDArray[np.int64]
    n_unsorted: int = 0  # rows of both lists that were out of order and have been sorted


@dataclass(frozen=True)
class Sequence:
    """One sequence: calibration and data, images by path."""

    name: str  # name of the folder
    folder: Path  # the folder that contains ``mav0``
    cameras: tuple[Camera, ...]  # left and right, or the only one
    frames: StereoFrames  # image files
    imu: ImuSamples  # samples as recorded, biases in
    imu_noise: ImuNoise  # densities as published in ``imu0/sensor.yaml``
    n_repeated_imu: int = 0  # identical repeated inertial rows that were left out
    n_unsorted_imu: int = 0  # inertial rows that were out of order and have been sorted


def read_sequence(folder: Path, *, sort: bool = False) -> Sequence:
    """Read a folder that contains ``mav0``; images are checked for existence, not opened.

    A recording without a folder ``cam1`` is one of one camera. ``sort`` puts rows of ``data.csv`` files in
    order of time; without it, rows out of order are an error.

    Raises DataError for a missing folder or file, and for whatever is wrong in one of them.
    """
    folder = Path(folder)
    mav = folder / "mav0"
    if not mav.is_dir():
        raise DataError(mav, "sequence folder must exist and contain mav0")
    cameras = tuple(read_camera(mav / name / "sensor.yaml") for name in camera_names(mav))
    baseline = float(np.linalg.norm(cameras[-1].p_BC - cameras[0].p_BC))
    if len(cameras) == 2 and baseline < _LEAST_BASELINE_M:
        rule = "the two cameras must be apart"
        raise DataError(mav / "cam1" / "sensor.yaml", rule, field="T_BS", value=f"{baseline} m")
    imu, imu_table = read_imu(mav / "imu0" / "data.csv", sort)
    return Sequence(
        name=folder.resolve().name,
        folder=folder,
        cameras=cameras,
        frames=read_frames(mav, sort),
        imu=imu,
        imu_noise=read_imu_noise(mav / "imu0" / "sensor.yaml"),
        n_repeated_imu=imu_table.n_repeated,
        n_unsorted_imu=imu_table.n_unsorted,
    )


def camera_names(mav: Path) -> tuple[str, ...]:
    """cam0 and cam1, or cam0 alone where there is no folder cam1."""
    return ("cam0", "cam1") if (mav / "cam1").exists() else ("cam0",)


def read_frames(mav: Path, sort: bool = False) -> StereoFrames:
    """Frames of ``mav0``; images are checked for existence, not opened. DataError as above."""
    left = read_table(mav / "cam0" / "data.csv", (2,), sort=sort)
    if len(camera_names(mav)) == 1:
        rows = np.arange(len(left.t_ns))
        none = np.empty(0, dtype=np.int64)
        return StereoFrames(left.t_ns, _image_paths(left, rows), (), none, left.n_unsorted)
    right = read_table(mav / "cam1" / "data.csv", (2,), sort=sort)
    partner, distance = nearest_index(right.t_ns, left.t_ns)
    paired = np.flatnonzero(distance <= STEREO_TOLERANCE_NS)
    if len(paired) == 0:
        raise DataError(
            right.path, "must share stamps with cam0", field="timestamp", value=int(right.t_ns[0])
        )
    return StereoFrames(
        t_ns=left.t_ns[paired],
        left=_image_paths(left, paired),
        right=_image_paths(right, partner[paired]),
        dropped_ns=left.t_ns[distance > STEREO_TOLERANCE_NS],
        n_unsorted=left.n_unsorted + right.n_unsorted,
    )


def _image_paths(table: Table, rows: NDArray[np.intp]) -> tuple[Path, ...]:
    """The files that rows name, which must exist and lie inside the ``data`` folder.

    That folder may itself be a link; a link inside it must not lead out of it.
    """
    folder = table.path.parent / "data"
    inside = folder.resolve()
    paths = []
    for k in rows:
        name, line = table.fields[k][0], int(table.lines[k])
        parts = PureWindowsPath(name)  # knows both kinds of slashes, and drives
        if not name or "\x00" in name or parts.anchor or ".." in parts.parts:
            rule = "must name a file inside the data folder"
            raise DataError(table.path, rule, row=line, field="filename", value=name)
        path = folder / name
        try:
            missing = not path.is_file()
            leaves = not missing and not path.resolve().is_relative_to(inside)
        except OSError as error:  # a name longer than the file system allows
            rule = f"must name a file: {error.strerror}"
            raise DataError(table.path, rule, row=line, field="filename", value=name) from error
        if missing:
            raise DataError(table.path, "image file must exist", row=line, field="filename", value=name)
        if leaves:
            rule = "must not lead out of the data folder through a link"
            raise DataError(table.path, rule, row=line, field="filename", value=name)
        paths.append(path)
    return tuple(paths)


def _quantity(name: str) -> str:
    """What a column measures by its name (w_x, ang_vel_x, linear_acceleration.x): gyro, accel or nothing."""
    low = name.strip().lower()
    for words, quantity in ((("ang", "gyr", "omega"), "gyro"), (("acc", "lin", "force"), "accel")):
        if any(word in low for word in words):
            return quantity
    return {"w": "gyro", "g": "gyro", "a": "accel", "f": "accel"}.get(low[:1], "")


def read_imu(path: Path, sort: bool = False) -> tuple[ImuSamples, Table]:
    """Inertial samples, and the table they come from with its counts. DataError as above."""
    table = read_table(path, (7,), drop_repeated=True, sort=sort, fastest_ns=FASTEST_SAMPLES_NS)
    for k, name in enumerate(table.columns[1:7], start=1):
        if _quantity(name) == ("accel" if k <= 3 else "gyro"):
            rule = "columns must be stamp, angular velocity (w), specific force (a)"
            raise DataError(path, rule, row=1, field="header", value=name)
    values = table.numbers()
    gyro, accel = values[:, :3], values[:, 3:]
    force = float(np.median(np.linalg.norm(accel, axis=1)))
    if not _MEDIAN_FORCE_MPS2[0] < force < _MEDIAN_FORCE_MPS2[1]:
        rule = "specific force must be in m/s^2 and in the last three columns (its median is near 9.8)"
        raise DataError(path, rule, field="a", value=force)
    fast = np.abs(gyro).max(axis=1) > _LARGEST_RATE_RADPS
    if np.any(fast):
        k = int(np.argmax(fast))
        rule = f"angular velocity must be in rad/s (below {_LARGEST_RATE_RADPS:g})"
        raise DataError(path, rule, row=int(table.lines[k]), field="w", value=gyro[k].tolist())
    return ImuSamples(table.t_ns, gyro, accel), table
