"""Contents of a small, valid ASL folder, spelt out so that no code under test has a part in it."""

from pathlib import Path

import cv2
import numpy as np

CAMERA_YAML = """\
sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: [0.0, -1.0, 0.0, {x},
         1.0, 0.0, 0.0, 0.0,
         0.0, 0.0, 1.0, 0.01,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [40, 30]
camera_model: pinhole
intrinsics: [30.0, 31.0, 19.5, 14.5] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 2e-4, 1.7e-05]
"""
IMU_YAML = """\
sensor_type: imu
T_BS:
  cols: 4
  rows: 4
  data: [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
rate_hz: 200
gyroscope_noise_density: 1.6968e-04
accelerometer_noise_density: 2e-3
"""
IMU_HEADER = "#timestamp [ns],w_RS_S_x,w_RS_S_y,w_RS_S_z,a_RS_S_x,a_RS_S_y,a_RS_S_z\n"
START_NS = 1403636580763555584
FRAME_NS = [START_NS + 50_000_000 * k for k in range(4)]
IMU_NS = [START_NS + 5_000_000 * k for k in range(40)]


def grey_image(seed: int = 0) -> np.ndarray:
    """(30, 40) noise, which no codec makes very short."""
    return np.random.default_rng(seed).integers(0, 256, (30, 40), dtype=np.uint8)


def write_sequence(folder: Path) -> Path:
    """A valid sequence of 4 stereo frames and 40 inertial samples."""
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
