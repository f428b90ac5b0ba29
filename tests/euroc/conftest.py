"""A small, valid ASL folder, ready to be spoilt."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest

from support.asl import CAMERA_YAML, FRAME_NS, IMU_HEADER, IMU_NS, IMU_YAML, grey_image


@pytest.fixture
def sequence_folder(tmp_path: Path) -> Path:
    """A sequence of 4 stereo frames and 40 inertial samples."""
    folder = tmp_path / "flight"
    for number, name in enumerate(("cam0", "cam1")):
        camera = folder / "mav0" / name
        (camera / "data").mkdir(parents=True)
        (camera / "sensor.yaml").write_text(CAMERA_YAML.format(x=0.11 * number))
        rows = "".join(f"{t},{t}.png\n" for t in FRAME_NS)
        (camera / "data.csv").write_text("#timestamp [ns],filename\n" + rows)
        for k, t in enumerate(FRAME_NS):
            assert cv2.imwrite(str(camera / "data" / f"{t}.png"), grey_image(10 * number + k))
    imu = folder / "mav0" / "imu0"
    imu.mkdir()
    (imu / "sensor.yaml").write_text(IMU_YAML)
    rows = "".join(f"{t},0.1,-0.2,0.3,9.7,0.4,{k / 100}\n" for k, t in enumerate(IMU_NS))
    (imu / "data.csv").write_text(IMU_HEADER + rows)
    return folder


@pytest.fixture
def truth_folder(tmp_path: Path) -> Path:
    """A ground-truth folder of 17 columns, standing still, at 200 Hz."""
    folder = tmp_path / "state_groundtruth_estimate0"
    folder.mkdir()
    columns = ["#timestamp", "px", "py", "pz", "qw", "qx", "qy", "qz"]
    columns += [f"{name}{axis}" for name in ("v", "bw", "ba") for axis in "xyz"]
    row = "1,2,3,0.5,0.5,-0.5,0.5,0.1,0.2,0.3,0.01,0.02,0.03,-0.1,-0.2,-0.3"
    text = ",".join(columns) + "\n" + "".join(f"{t},{row}\n" for t in IMU_NS)
    (folder / "data.csv").write_text(text)
    return folder
