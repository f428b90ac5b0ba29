"""A rendered sequence as an ASL folder, EuRoC's layout, so that the same reader takes both."""

import json
import os
import shutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from vigauge.errors import DataError
from vigauge.files import remove_leftovers
from vigauge.geometry import so3
from vigauge.geometry.camera import EQUIDISTANT, RADIAL_TANGENTIAL, Camera
from vigauge.geometry.so3 import Array

from ..ids import STAND_IN
from .flight import EUROC_BIAS_WALK, EUROC_CAMERA_RATE_HZ, EUROC_IMU_RATE_HZ
from .rendering import START_NS, RenderedSequence

# The fastest that is still half the size of raw pixels (noise hardly compresses); without loss.
_PNG_OPTIONS = [
    cv2.IMWRITE_PNG_COMPRESSION,
    1,
    cv2.IMWRITE_PNG_STRATEGY,
    cv2.IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY,
]

_IMU_COLUMNS = (
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]"
)
_TRUTH_COLUMNS = (
    "#timestamp,p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z [],"
    "v_RS_R_x [m s^-1],v_RS_R_y [m s^-1],v_RS_R_z [m s^-1],"
    "b_w_RS_S_x [rad s^-1],b_w_RS_S_y [rad s^-1],b_w_RS_S_z [rad s^-1],"
    "b_a_RS_S_x [m s^-2],b_a_RS_S_y [m s^-2],b_a_RS_S_z [m s^-2]"
)
_CALIBRATIONS = {RADIAL_TANGENTIAL: "EuRoC's", EQUIDISTANT: "TUM-VI's"}
Progress = Callable[[Iterable[Any], int], Iterable[Any]]


def write_asl_folder(
    sequence: RenderedSequence,
    scene_name: str,
    folder: Path,
    versions: Mapping[str, str],
    progress: Progress = lambda items, total: items,
) -> None:
    """Write ``folder/mav0`` and ``folder/rendered.json``, with the ``versions`` it was made by.

    Images go to a folder beside, which takes its name when all is written; ``rendered.json``
    comes last, so its presence says that the sequence is whole. An earlier rendering is replaced.

    Raises DataError where the folder holds a sequence that was not rendered: real data are never replaced.
    """
    folder.mkdir(parents=True, exist_ok=True)
    about = folder / "rendered.json"
    if (folder / "mav0").exists() and not _is_rendered(folder / "mav0"):
        raise DataError(
            folder / "mav0", "must not exist, or be a rendered stand-in: real data are never replaced"
        )
    about.unlink(missing_ok=True)
    remove_leftovers(folder / "mav0")
    temporary = folder / f".mav0.{os.getpid()}"
    try:
        _write_mav0(sequence, temporary, progress)
        shutil.rmtree(folder / "mav0", ignore_errors=True)
        temporary.rename(folder / "mav0")
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    description = {
        "notice": STAND_IN,
        "scene": scene_name,
        "settings": asdict(sequence.settings),
        "versions": dict(versions),
    }
    about.write_text(json.dumps(description, indent=2, sort_keys=True) + "\n", encoding="utf-8")


def _is_rendered(mav0: Path) -> bool:
    """Whether a sequence says of itself that it was rendered."""
    body = mav0 / "body.yaml"
    return body.is_file() and STAND_IN in body.read_text(encoding="utf-8")


def _write_mav0(sequence: RenderedSequence, mav0: Path, progress: Progress) -> None:
    for name, camera in zip(("cam0", "cam1"), sequence.cameras, strict=True):
        (mav0 / name / "data").mkdir(parents=True)
        _write_yaml(mav0 / name / "sensor.yaml", _camera_description(name, camera))
        rows = "".join(f"{t},{t}.png\n" for t in sequence.frame_ns)
        (mav0 / name / "data.csv").write_text("#timestamp [ns],filename\n" + rows, encoding="utf-8")
    for t, pair in zip(sequence.frame_ns, progress(sequence.images(), len(sequence.frame_ns)), strict=True):
        for name, image in zip(("cam0", "cam1"), pair, strict=True):
            path = mav0 / name / "data" / f"{t}.png"
            if not cv2.imwrite(str(path), image, _PNG_OPTIONS):
                raise DataError(path, "image must be writable")
    _write_imu(sequence, mav0 / "imu0")
    _write_truth(sequence, mav0 / "state_groundtruth_estimate0")
    _write_yaml(mav0 / "body.yaml", {"comment": STAND_IN})


def _write_yaml(path: Path, content: dict[str, Any]) -> None:
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")


def _transformation(T: Array) -> dict[str, Any]:
    return {"cols": 4, "rows": 4, "data": [float(value) for value in T.ravel()]}


def _camera_description(name: str, camera: Camera) -> dict[str, Any]:
    return {
        "sensor_type": "camera",
        "comment": f"{name} of a {STAND_IN}; {_CALIBRATIONS[camera.lens]} calibration",
        "T_BS": _transformation(camera.T_BC),
        "rate_hz": EUROC_CAMERA_RATE_HZ,
        "resolution": [camera.width, camera.height],
        "camera_model": "pinhole",
        "intrinsics": [camera.fx, camera.fy, camera.cx, camera.cy],
        "distortion_model": camera.lens,
        "distortion_coefficients": list(camera.distortion),
    }


def _write_table(path: Path, header: str, t_ns: Iterable[int], values: Array) -> None:
    """Stamp and columns; floats with all their digits."""
    rows = (f"{t}," + ",".join(map(repr, row)) for t, row in zip(t_ns, values.tolist(), strict=True))
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")


def _write_imu(sequence: RenderedSequence, folder: Path) -> None:
    folder.mkdir()
    samples = sequence.imu.samples
    _write_table(folder / "data.csv", _IMU_COLUMNS, samples.t_ns, np.hstack([samples.gyro, samples.accel]))
    description = {
        "sensor_type": "imu",
        "comment": f"inertial sensor of a {STAND_IN}",
        "T_BS": _transformation(np.eye(4)),
        "rate_hz": EUROC_IMU_RATE_HZ,
        "gyroscope_noise_density": sequence.imu_noise.gyro_density,
        "gyroscope_random_walk": EUROC_BIAS_WALK.gyro_density,
        "accelerometer_noise_density": sequence.imu_noise.accel_density,
        "accelerometer_random_walk": EUROC_BIAS_WALK.accel_density,
    }
    _write_yaml(folder / "sensor.yaml", description)


def _write_truth(sequence: RenderedSequence, folder: Path) -> None:
    """Exact poses, velocities and biases at the inertial stamps (17 columns)."""
    folder.mkdir()
    t_ns = sequence.imu.samples.t_ns
    t = (t_ns - START_NS) * 1e-9
    motion = sequence.trajectory
    columns = [
        motion.p_W(t),
        so3.quaternion(motion.R_WB(t)),
        motion.v_W(t),
        sequence.imu.gyro_bias,
        sequence.imu.accel_bias,
    ]
    _write_table(folder / "data.csv", _TRUTH_COLUMNS, t_ns, np.hstack(columns))
    _write_yaml(
        folder / "sensor.yaml", {"sensor_type": "visual-inertial", "comment": f"exact truth of a {STAND_IN}"}
    )
