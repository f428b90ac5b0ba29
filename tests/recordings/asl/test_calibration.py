"""``sensor.yaml``: read exactly, and refused where it describes another kind of sensor."""

from pathlib import Path

import numpy as np
import pytest

from support.asl import CAMERA_YAML, IMU_YAML
from vigauge.errors import DataError
from vigauge.geometry.camera import Camera
from vigauge.model.imu import ImuNoise
from vigauge.recordings.asl.calibration import read_camera, read_imu_noise, unusual_densities

CAMERA = CAMERA_YAML.format(x=0.11)


def camera_of(tmp_path: Path, text: str) -> Camera:
    (tmp_path / "sensor.yaml").write_text(text)
    return read_camera(tmp_path / "sensor.yaml")


def refused(tmp_path: Path, text: str, read=read_camera) -> DataError:
    (tmp_path / "sensor.yaml").write_text(text)
    with pytest.raises(DataError) as caught:
        read(tmp_path / "sensor.yaml")
    assert caught.value.file == str(tmp_path / "sensor.yaml")
    return caught.value


@pytest.mark.parametrize(
    "first", ["", "%YAML:1.0\n", "%YAML:1.0\n---\n", "\ufeff%YAML:1.0\n", "%YAML 1.0\n---\n"]
)
def test_camera_is_read_with_and_without_the_opencv_line(tmp_path, first):
    """Catches a plain YAML reader, which refuses the line, and swapped entries."""
    camera = camera_of(tmp_path, first + CAMERA)
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (30.0, 31.0, 19.5, 14.5)
    assert (camera.width, camera.height) == (40, 30)
    assert camera.distortion == (-0.28, 0.07, 2e-4, 1.7e-05)
    assert np.allclose(camera.p_BC, [0.11, 0.0, 0.01], rtol=0, atol=0)
    # Row by row, sensor to body: the camera's x axis is the body's y axis.
    assert np.allclose(camera.R_BC @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], rtol=0, atol=1e-15)


def test_lenses_are_read_with_their_coefficients(tmp_path):
    """Catches a fisheye read as another lens, and k3 left out."""
    fifth = camera_of(tmp_path, CAMERA.replace("1.7e-05]", "1.7e-05, 3e-3]"))
    assert (fifth.lens, fifth.distortion) == ("radial-tangential", (-0.28, 0.07, 2e-4, 1.7e-05, 3e-3))
    fisheye = CAMERA.replace("radial-tangential", "equidistant")
    assert camera_of(tmp_path, fisheye).lens == "equidistant"
    refusal = refused(tmp_path, fisheye.replace("1.7e-05]", "1.7e-05, 3e-3]"))
    assert refusal.field == "distortion_coefficients"


def test_rounded_rotation_becomes_an_exact_one(tmp_path):
    """Catches six published digits that would later fail as 'no rotation matrix'."""
    angle = 0.3
    c, s = f"{np.cos(angle):.5f}", f"{np.sin(angle):.5f}"
    text = CAMERA.replace("[0.0, -1.0, 0.0,", f"[{c}, -{s}, 0.0,").replace(
        "1.0, 0.0, 0.0, 0.0,", f"{s}, {c}, 0.0, 0.0,", 1
    )
    R_BC = camera_of(tmp_path, text).R_BC
    assert np.abs(R_BC @ R_BC.T - np.eye(3)).max() < 1e-15
    assert abs(np.arctan2(R_BC[1, 0], R_BC[0, 0]) - angle) < 1e-5


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("pinhole", "omni", "camera_model"),
        ("radial-tangential", "omni", "distortion_model"),
        ("intrinsics: [30.0, 31.0, 19.5, 14.5]", "intrinsics: [30.0, 31.0, 19.5]", "intrinsics"),
        ("intrinsics: [30.0, 31.0, 19.5, 14.5]", "no_intrinsics: 0", "intrinsics"),
        ("[30.0, 31.0", "[-30.0, 31.0", "intrinsics"),
        ("[30.0, 31.0", "[.nan, 31.0", "intrinsics"),
        ("[30.0, 31.0", "[thirty, 31.0", "intrinsics"),
        ("[30.0, 31.0", "[true, 31.0", "intrinsics"),
        ("resolution: [40, 30]", "resolution: [40, 30.5]", "resolution"),
        ("resolution: [40, 30]", "resolution: [0, 30]", "resolution"),
        ("resolution: [40, 30]", "resolution: 40x30", "resolution"),
        ("[-0.28, 0.07, 2e-4, 1.7e-05]", "[-0.28, 0.07, 2e-4]", "distortion_coefficients"),
        ("[-0.28, 0.07, 2e-4, 1.7e-05]", "[-0.28, 0.07, 2e-4, 1e-5, 0.0, 0.0]", "distortion_coefficients"),
        ("T_BS:", "T_SB:", "T_BS"),
        ("1.0, 0.0, 0.0, 0.0,", "1.0, 0.0, 0.0,", "data"),
        ("0.0, 0.0, 0.0, 1.0]", "0.0, 0.0, 0.1, 1.0]", "T_BS"),
        ("[0.0, -1.0, 0.0,", "[0.0, 1.0, 0.0,", "T_BS"),  # a mirror
        ("[0.0, -1.0, 0.0,", "[0.0, -1.1, 0.0,", "T_BS"),  # a scale
    ],
)
def test_bad_camera_entry_is_named(tmp_path, old, new, field):
    """Catches a calibration of another model, or broken, that would pass as pinhole."""
    assert old in CAMERA
    assert refused(tmp_path, CAMERA.replace(old, new)).field == field


@pytest.mark.parametrize(
    "text", ["", "just words", "- a\n- list\n", "a: [1, 2\n", "a: !!python/object:os.system x\n"]
)
def test_what_is_not_a_plain_yaml_mapping_is_refused(tmp_path, text):
    """Catches a loader that runs tags, and None or a list treated as a mapping."""
    refused(tmp_path, text)


def test_missing_sensor_file_is_named(tmp_path):
    with pytest.raises(DataError, match="sensor.yaml: file must exist"):
        read_camera(tmp_path / "sensor.yaml")


def test_imu_noise_is_read_as_published(tmp_path):
    """Catches densities exchanged, and ``2e-3`` left as the text that YAML 1.1 sees in it."""
    (tmp_path / "sensor.yaml").write_text(IMU_YAML)
    noise = read_imu_noise(tmp_path / "sensor.yaml")
    assert (noise.gyro_density, noise.accel_density) == (1.6968e-4, 2e-3)


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("data: [1.0, 0.0, 0.0, 0.0,", "data: [1.0, 0.0, 0.0, 0.05,", "T_BS"),
        ("gyroscope_noise_density: 1.6968e-04", "", "gyroscope_noise_density"),
        ("2e-3", "0.0", "accelerometer_noise_density"),
        ("2e-3", "-0.1", "accelerometer_noise_density"),
    ],
)
def test_bad_imu_entry_is_named(tmp_path, old, new, field):
    """Catches a sensor off the body frame, and noise that would divide by zero."""
    assert old in IMU_YAML
    assert refused(tmp_path, IMU_YAML.replace(old, new), read_imu_noise).field == field


@pytest.mark.parametrize(
    ("text", "read", "field"),
    [
        (CAMERA + "timeshift_cam_imu: 0.01\n", read_camera, "timeshift_cam_imu"),
        (IMU_YAML + "time_offset: 0.01\n", read_imu_noise, "time_offset"),
        (CAMERA.replace("cols: 4", "cols: 3"), read_camera, "T_BS.cols"),
        (CAMERA.replace("sensor_type: camera", "sensor_type: imu"), read_camera, "sensor_type"),
    ],
)
def test_key_without_effect_is_refused(tmp_path, text, read, field):
    """Catches keys that are dropped, and the file of another sensor."""
    assert refused(tmp_path, text, read).field == field


@pytest.mark.parametrize(
    ("densities", "words"),
    [
        ((1.7e-4, 2e-3), []),
        ((1.7e-4 * 57.3, 2e-3), ["gyroscope"]),
        ((1.7e-4 / 57.3, 2e-3), ["gyroscope"]),
        ((1.7e-4, 2e-3 * 50.0), ["accelerometer"]),
    ],
)
def test_density_that_no_sensor_has_is_told(densities, words):
    """Catches degrees for radians."""
    told = unusual_densities(ImuNoise(*densities))
    assert [sentence.split("_")[0] for sentence in told] == words
