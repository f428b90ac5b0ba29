"""Calibrations that Kalibr writes, as the ``sensor.yaml`` of an ASL folder."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import DataError
from ...geometry.so3 import Array
from .calibration import read_sensor_yaml

_LARGEST_SHIFT_S = 10.0


def camera_descriptions(camchain: Path) -> tuple[list[dict[str, Any]], int]:
    """The ``sensor.yaml`` of cam0 and cam1, and what to add to camera stamps, ns, from a camchain.

    Kalibr's ``T_cam_imu`` takes inertial to camera coordinates; ASL's ``T_BS`` is its inverse.
    Where cam1 has none it follows from cam0's by ``T_cn_cnm1``. ``timeshift_cam_imu`` is
    t_imu = t_cam + shift, s; one shift serves both cameras, which are triggered together.

    Raises DataError for a camera that is missing, not pinhole with radtan distortion, or
    without extrinsics.
    """
    content = read_sensor_yaml(camchain)
    chain = [_entry(camchain, content, name) for name in ("cam0", "cam1")]
    T_C0B = _matrix(camchain, "cam0", chain[0], "T_cam_imu")
    if "T_cam_imu" in chain[1]:
        T_C1B = _matrix(camchain, "cam1", chain[1], "T_cam_imu")
    else:
        T_C1B = _matrix(camchain, "cam1", chain[1], "T_cn_cnm1") @ T_C0B
    descriptions = [
        _description(camchain, name, camera, T_CB)
        for name, camera, T_CB in zip(("cam0", "cam1"), chain, (T_C0B, T_C1B), strict=True)
    ]
    shift = chain[0].get("timeshift_cam_imu", 0.0)
    if isinstance(shift, bool) or not isinstance(shift, (int, float)) or not abs(shift) < _LARGEST_SHIFT_S:
        rule = f"must be seconds, less than {_LARGEST_SHIFT_S:g}"
        raise DataError(camchain, rule, field="cam0.timeshift_cam_imu", value=shift)
    return descriptions, round(shift * 1e9)


def imu_description(path: Path) -> dict[str, Any]:
    """The ``sensor.yaml`` of the inertial sensor from Kalibr's ``imu.yaml``; its frame is the body's."""
    content = read_sensor_yaml(path)
    content = content.get("imu0", content)
    if not isinstance(content, dict):
        raise DataError(path, "must be a mapping", field="imu0", value=content)
    keys = (
        "gyroscope_noise_density",
        "gyroscope_random_walk",
        "accelerometer_noise_density",
        "accelerometer_random_walk",
    )
    for key in keys:
        if key not in content:
            raise DataError(path, "must be given", field=key)
    return {"sensor_type": "imu", "T_BS": _transformation(np.eye(4)), **{key: content[key] for key in keys}}


def _entry(path: Path, content: Mapping[str, Any], name: str) -> dict[str, Any]:
    entry = content.get(name)
    if not isinstance(entry, dict):
        raise DataError(path, "must describe cam0 and cam1", field=name, value=entry)
    return entry


def _matrix(path: Path, camera: str, entry: Mapping[str, Any], key: str) -> Array:
    """(4, 4) rigid transformation; DataError where it is none."""
    field, value = f"{camera}.{key}", entry.get(key)
    try:
        T = np.array(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise DataError(path, "must be 4 rows of 4 numbers", field=field, value=value) from error
    if T.shape != (4, 4) or not np.all(np.isfinite(T)):
        raise DataError(path, "must be 4 rows of 4 numbers", field=field, value=value)
    if np.abs(T[:3, :3] @ T[:3, :3].T - np.eye(3)).max() > 1e-3 or np.linalg.det(T[:3, :3]) < 0.0:
        raise DataError(path, "must be a rigid transformation", field=field, value=value)
    return T


def _description(path: Path, name: str, camera: Mapping[str, Any], T_CB: Array) -> dict[str, Any]:
    for key, model in (("camera_model", "pinhole"), ("distortion_model", "radtan")):
        if camera.get(key) != model:
            raise DataError(path, f"must be {model}", field=f"{name}.{key}", value=camera.get(key))
    return {
        "sensor_type": "camera",
        "T_BS": _transformation(np.linalg.inv(T_CB)),
        "resolution": camera.get("resolution"),
        "camera_model": "pinhole",
        "intrinsics": camera.get("intrinsics"),
        "distortion_model": "radial-tangential",
        "distortion_coefficients": camera.get("distortion_coeffs"),
    }


def _transformation(T: Array) -> dict[str, Any]:
    return {"cols": 4, "rows": 4, "data": [float(value) for value in T.ravel()]}
