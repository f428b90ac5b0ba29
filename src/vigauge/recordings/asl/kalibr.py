"""Calibrations that Kalibr writes, as the ``sensor.yaml`` of an ASL folder."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...arrays import LARGEST
from ...errors import DataError
from ...geometry.camera import EQUIDISTANT, RADIAL_TANGENTIAL
from ...geometry.so3 import Array
from .calibration import read_sensor_yaml

_LARGEST_SHIFT_S = 10.0
# Kalibr estimates a shift per camera; those of cameras that are triggered together differ by its noise.
_SHIFT_NOISE_S = 1e-4
# Kalibr prints every digit of its matrices.
_SAME_POSE = 1e-6
_CAMERA_KEYS = {
    "camera_model",
    "intrinsics",
    "distortion_model",
    "distortion_coeffs",
    "resolution",
    "T_cam_imu",
    "T_cn_cnm1",
    "timeshift_cam_imu",
    "cam_overlaps",
    "rostopic",
}
_DENSITIES = (
    "gyroscope_noise_density",
    "gyroscope_random_walk",
    "accelerometer_noise_density",
    "accelerometer_random_walk",
)
_IMU_KEYS = {*_DENSITIES, "rostopic", "update_rate", "T_i_b", "time_offset", "model"}
_LENSES = {"radtan": RADIAL_TANGENTIAL, "equidistant": EQUIDISTANT}
_INTRINSICS = ("accelerometers", "gyroscopes")


@dataclass(frozen=True)
class CameraChain:
    """What a camchain says of cam0 and cam1, or of cam0 alone."""

    descriptions: tuple[dict[str, Any], ...]  # the ``sensor.yaml`` of each
    shifts_ns: tuple[int, ...]  # what to add to the stamps of each
    topics: tuple[object, ...]  # ``rostopic`` of each, or None
    notes: tuple[str, ...]  # sentences on what is not used as it stands


def camera_chain(camchain: Path) -> CameraChain:
    """cam0 and cam1 of a camchain; cam0 alone where it has no cam1.

    Kalibr's ``T_cam_imu`` takes inertial to camera coordinates; ASL's ``T_BS`` is its inverse.
    Where cam1 has none it follows from cam0's by ``T_cn_cnm1``. ``timeshift_cam_imu`` is
    t_imu = t_cam + shift, s. Each camera is moved by its own; where they differ by less than
    Kalibr's noise both are moved by cam0's, so that pairs keep equal stamps.

    Raises DataError for a camera that is missing, not pinhole with radtan or equidistant distortion, or
    without extrinsics; for keys that are unknown or contradict each other.
    """
    content = read_sensor_yaml(camchain)
    others = sorted(str(name) for name in content if not re.fullmatch(r"cam\d+", str(name)))
    if others:
        raise DataError(camchain, "must hold cam0, cam1 and nothing else: remove the key", field=others[0])
    names = ("cam0", "cam1") if "cam1" in content else ("cam0",)
    chain = [_entry(camchain, content, name) for name in names]
    for name, camera in zip(names, chain, strict=True):
        _refuse_unknown(camchain, camera, _CAMERA_KEYS, f"{name}.")
    poses = [_matrix(camchain, "cam0", chain[0], "T_cam_imu")]
    poses += [_pose_of_cam1(camchain, camera, poses[0]) for camera in chain[1:]]
    notes = [f"{camchain}, {name}: is not used" for name in content if name not in names]
    shifts = _shifts_s(camchain, chain)
    apart = abs(shifts[-1] - shifts[0])
    if 0.0 < apart <= _SHIFT_NOISE_S:
        notes.append(
            f"{camchain}: the time shifts of cam0 and cam1 differ by {1e6 * apart:.3g} us, which is noise; "
            "cam0's is used for both"
        )
        shifts = [shifts[0], shifts[0]]
    return CameraChain(
        tuple(_description(camchain, *of) for of in zip(names, chain, poses, strict=True)),
        tuple(round(shift * 1e9) for shift in shifts),
        tuple(camera.get("rostopic") for camera in chain),
        tuple(notes),
    )


def _pose_of_cam1(path: Path, camera: Mapping[str, Any], T_C0B: Array) -> Array:
    """(4, 4) inertial to cam1; DataError where it is given twice and differently."""
    if "T_cn_cnm1" not in camera:
        return _matrix(path, "cam1", camera, "T_cam_imu")
    chained = _matrix(path, "cam1", camera, "T_cn_cnm1") @ T_C0B
    if "T_cam_imu" in camera:
        T_C1B = _matrix(path, "cam1", camera, "T_cam_imu")
        if np.abs(T_C1B - chained).max() > _SAME_POSE:
            rule = "must be T_cn_cnm1 times cam0's T_cam_imu: remove the one of the two that is wrong"
            raise DataError(path, rule, field="cam1.T_cam_imu", value=T_C1B.tolist())
        return T_C1B
    return chained


def _shifts_s(path: Path, chain: list[dict[str, Any]]) -> list[float]:
    key = "timeshift_cam_imu"
    if (key in chain[0]) != (key in chain[-1]):
        missing = 0 if key in chain[-1] else 1
        raise DataError(path, "must be given for both cameras or for none", field=f"cam{missing}.{key}")
    shifts = []
    for k, camera in enumerate(chain):
        shift = camera.get(key, 0.0)
        if (
            isinstance(shift, bool)
            or not isinstance(shift, (int, float))
            or not abs(shift) < _LARGEST_SHIFT_S
        ):
            rule = f"must be seconds, less than {_LARGEST_SHIFT_S:g}"
            raise DataError(path, rule, field=f"cam{k}.{key}", value=shift)
        shifts.append(float(shift))
    return shifts


def imu_description(path: Path) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The ``sensor.yaml`` of the inertial sensor from Kalibr's ``imu.yaml``, and notes on what is not used.

    Its frame and its clock are the body's.

    Raises DataError for densities that are missing, for keys that are unknown, and for a pose,
    a time offset or an intrinsic calibration of the sensor: samples are written as recorded.
    """
    content = read_sensor_yaml(path)
    notes: list[str] = []
    if "imu0" in content:
        others = [str(name) for name in content if re.fullmatch(r"imu[1-9]\d*", str(name))]
        _refuse_unknown(path, content, {"imu0", *others}, "")
        notes = [f"{path}, {name}: is not used" for name in others]
        content = content["imu0"]
    if not isinstance(content, dict):
        raise DataError(path, "must be a mapping", field="imu0", value=content)
    for key in _INTRINSICS:
        if key in content:
            rule = (
                "must be absent: samples are not corrected by an intrinsic calibration; correct them before"
            )
            raise DataError(path, rule, field=key, value=content[key])
    _refuse_unknown(path, content, _IMU_KEYS, "")
    if content.get("model", "calibrated") != "calibrated":
        rule = "must be calibrated: samples are not corrected for scale and misalignment; correct them before"
        raise DataError(path, rule, field="model", value=content["model"])
    if "T_i_b" in content and np.abs(_matrix(path, "", content, "T_i_b") - np.eye(4)).max() > _SAME_POSE:
        rule = "must be the identity: body and inertial frame are the same here"
        raise DataError(path, rule, field="T_i_b", value=content["T_i_b"])
    if content.get("time_offset", 0.0) != 0.0:
        rule = "must be 0: stamps of samples are not moved; the cameras' timeshift_cam_imu are"
        raise DataError(path, rule, field="time_offset", value=content["time_offset"])
    for key in _DENSITIES:
        if key not in content:
            raise DataError(path, "must be given", field=key)
    rate = {"rate_hz": content["update_rate"]} if "update_rate" in content else {}
    densities = {key: content[key] for key in _DENSITIES}
    return {"sensor_type": "imu", "T_BS": _transformation(np.eye(4)), **rate, **densities}, tuple(notes)


def _refuse_unknown(path: Path, content: Mapping[str, Any], known: Collection[str], where: str) -> None:
    """DataError for a key that nothing here reads."""
    for key in content:
        if key not in known:
            rule = "is not a key of Kalibr's that is used here: remove it, or correct its name"
            raise DataError(path, rule, field=f"{where}{key}", value=content[key])


def _entry(path: Path, content: Mapping[str, Any], name: str) -> dict[str, Any]:
    entry = content.get(name)
    if not isinstance(entry, dict):
        raise DataError(path, "must describe the camera", field=name, value=entry)
    return entry


def _matrix(path: Path, camera: str, entry: Mapping[str, Any], key: str) -> Array:
    """(4, 4) rigid transformation; DataError where it is none."""
    field, value = f"{camera}.{key}".lstrip("."), entry.get(key)
    try:
        T = np.array(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise DataError(path, "must be 4 rows of 4 numbers", field=field, value=value) from error
    if T.shape != (4, 4) or not np.all(np.isfinite(T)):
        raise DataError(path, "must be 4 rows of 4 numbers", field=field, value=value)
    turn, last = T[:3, :3], T[3] - [0.0, 0.0, 0.0, 1.0]
    small = np.abs(T).max() < LARGEST
    if not small or np.abs(turn @ turn.T - np.eye(3)).max() > 1e-3 or np.linalg.det(turn) < 0.0 or last.any():
        raise DataError(path, "must be a rigid transformation", field=field, value=value)
    return T


def _description(path: Path, name: str, camera: Mapping[str, Any], T_CB: Array) -> dict[str, Any]:
    for key, models in (("camera_model", ("pinhole",)), ("distortion_model", tuple(_LENSES))):
        if camera.get(key) not in models:
            rule = f"must be {' or '.join(models)}"
            raise DataError(path, rule, field=f"{name}.{key}", value=camera.get(key))
    return {
        "sensor_type": "camera",
        "T_BS": _transformation(np.linalg.inv(T_CB)),
        "resolution": camera.get("resolution"),
        "camera_model": "pinhole",
        "intrinsics": camera.get("intrinsics"),
        "distortion_model": _LENSES[camera["distortion_model"]],
        "distortion_coefficients": camera.get("distortion_coeffs"),
    }


def _transformation(T: Array) -> dict[str, Any]:
    return {"cols": 4, "rows": 4, "data": [float(value) for value in T.ravel()]}
