"""The ``sensor.yaml`` of ASL folders: cameras, and the noise of the inertial sensor."""

from __future__ import annotations

from collections.abc import Mapping, Set
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import DataError
from ...geometry.camera import LENSES, Camera
from ...geometry.so3 import Array
from ...model.imu import ImuNoise
from .plain_yaml import read_plain_yaml

# Published extrinsics have 6 to 12 digits.
_ROTATION_TOLERANCE = 1e-4
_IDENTITY_TOLERANCE = 1e-9
# No camera has more; a file that says so would make a lying image header pass.
_LARGEST_SIDE_PX = 16_384
_SENSOR_KEYS = frozenset({"sensor_type", "comment", "T_BS", "rate_hz"})
_CAMERA_KEYS = _SENSOR_KEYS | {
    "resolution",
    "camera_model",
    "intrinsics",
    "distortion_model",
    "distortion_coefficients",
}
_DENSITIES = ("gyroscope_noise_density", "accelerometer_noise_density")
_WALKS = ("gyroscope_random_walk", "accelerometer_random_walk")
_IMU_KEYS = _SENSOR_KEYS | {*_DENSITIES, *_WALKS}
# From tactical grade to what Kalibr's users inflate a cheap sensor to; in degrees the usual ones lie above.
_USUAL_GYRO, _USUAL_ACCEL = (1e-5, 5e-3), (1e-4, 5e-2)


def read_sensor_yaml(path: Path) -> Mapping[str, Any]:
    """The keys of a ``sensor.yaml``; DataError where the file is missing or no plain YAML mapping."""
    content = read_plain_yaml(path)
    if not isinstance(content, dict):
        raise DataError(path, "must hold a mapping of keys", value=type(content).__name__)
    return content


def read_camera(path: Path) -> Camera:
    """A camera with a radial-tangential or an equidistant lens from its ``sensor.yaml``.

    ``T_BS`` takes sensor to body coordinates, which is this package's ``T_BC``.
    """
    content = read_sensor_yaml(path)
    for key, models in (("camera_model", ("pinhole",)), ("distortion_model", tuple(LENSES))):
        if content.get(key) not in models:
            raise DataError(path, f"must be {' or '.join(models)}", field=key, value=content.get(key))
    lens = content["distortion_model"]
    fx, fy, cx, cy = _numbers(path, content, "intrinsics", 4)
    if fx <= 0.0 or fy <= 0.0:
        raise DataError(path, "focal lengths must be positive", field="intrinsics", value=(fx, fy))
    width, height = _numbers(path, content, "resolution", 2)
    if not all(side == int(side) and 1 <= side <= _LARGEST_SIDE_PX for side in (width, height)):
        rule = f"must be two whole numbers from 1 to {_LARGEST_SIDE_PX}"
        raise DataError(path, rule, field="resolution", value=(width, height))
    distortion = _numbers(path, content, "distortion_coefficients", *LENSES[lens])
    R_BC, p_BC = _rigid_transform(path, content)
    _refuse_unknown(path, content, _CAMERA_KEYS, "camera")
    return Camera(fx, fy, cx, cy, int(width), int(height), tuple(distortion), R_BC, p_BC, lens)


def read_imu_noise(path: Path) -> ImuNoise:
    """Noise as published in ``imu0/sensor.yaml``: densities, and the biases' random walks, 0 where not given.

    Raises DataError also where ``T_BS`` is not the identity: the body frame is the inertial sensor's.
    """
    content = read_sensor_yaml(path)
    R_BS, p_BS = _rigid_transform(path, content)
    if max(np.abs(R_BS - np.eye(3)).max(), np.abs(p_BS).max()) > _IDENTITY_TOLERANCE:
        rule = "must be the identity: body and inertial frame are the same here"
        raise DataError(path, rule, field="T_BS", value=np.column_stack([R_BS, p_BS]).tolist())
    densities, walks = [], []
    for key in _DENSITIES:
        density = _number(path, key, content.get(key))
        if density <= 0.0:
            raise DataError(path, "must be positive", field=key, value=density)
        densities.append(density)
    for key in _WALKS:
        walk = _number(path, key, content.get(key, 0.0))
        if walk < 0.0:
            raise DataError(path, "must not be negative", field=key, value=walk)
        walks.append(walk)
    _refuse_unknown(path, content, _IMU_KEYS, "imu")
    return ImuNoise(densities[0], densities[1], walks[0], walks[1])


def unusual_densities(noise: ImuNoise) -> list[str]:
    """A sentence on each noise density that no usual sensor has in rad/s/sqrt(Hz) or m/s^2/sqrt(Hz)."""
    rules = (
        ("gyroscope_noise_density", noise.gyro_density, _USUAL_GYRO, "rad/s/sqrt(Hz)", "degrees"),
        ("accelerometer_noise_density", noise.accel_density, _USUAL_ACCEL, "m/s^2/sqrt(Hz)", "g"),
    )
    return [
        f"{key} is {value:.3g}; {low:g} to {high:g} {unit} are usual: must not be in {other} or per sample"
        for key, value, (low, high), unit, other in rules
        if not low <= value <= high
    ]


def _refuse_unknown(path: Path, content: Mapping[str, Any], known: Set[str], kind: str) -> None:
    """DataError for another kind of sensor, and for a key that nothing here reads."""
    if content.get("sensor_type", kind) != kind:
        raise DataError(path, f"must be {kind}", field="sensor_type", value=content["sensor_type"])
    for key in content:
        if key not in known:
            rule = "is not a key that is used here: remove it, or correct its name"
            raise DataError(path, rule, field=str(key), value=content[key])


def _number(path: Path, key: str, value: object) -> float:
    # YAML 1.1 reads "2e-3" as text, so text is tried too; booleans would pass as 0 and 1.
    try:
        number = float("" if isinstance(value, bool) else value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        number = float("nan")
    if not np.isfinite(number):
        raise DataError(path, "must be a finite number", field=key, value=value)
    return number


def _numbers(path: Path, content: Mapping[str, Any], key: str, *lengths: int) -> list[float]:
    values = content.get(key)
    if not isinstance(values, list) or len(values) not in lengths:
        rule = f"must be a list of {' or '.join(map(str, lengths))} numbers"
        raise DataError(path, rule, field=key, value=values)
    return [_number(path, key, value) for value in values]


def _rigid_transform(path: Path, content: Mapping[str, Any]) -> tuple[Array, Array]:
    """(3, 3) rotation and (3,) translation, m, of ``T_BS``."""
    entry = content.get("T_BS")
    if not isinstance(entry, dict):
        raise DataError(path, "must be a mapping with rows, cols and data", field="T_BS", value=entry)
    for key in entry:
        if key not in ("rows", "cols", "data") or (key != "data" and entry[key] != 4):
            raise DataError(path, "must have 4 rows, 4 cols and data", field=f"T_BS.{key}", value=entry[key])
    T_BS = np.array(_numbers(path, entry, "data", 16)).reshape(4, 4)
    R_BS = T_BS[:3, :3]
    rigid = (
        np.abs(T_BS[3] - [0.0, 0.0, 0.0, 1.0]).max() < _IDENTITY_TOLERANCE
        and np.abs(R_BS @ R_BS.T - np.eye(3)).max() < _ROTATION_TOLERANCE
        and np.linalg.det(R_BS) > 0.0
    )
    if not rigid:
        rule = "must be a rigid transformation: a rotation, a translation, last row 0 0 0 1"
        raise DataError(path, rule, field="T_BS", value=T_BS.tolist())
    left, _, right = np.linalg.svd(R_BS)
    return left @ right, T_BS[:3, 3].copy()
