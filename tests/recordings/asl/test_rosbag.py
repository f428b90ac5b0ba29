"""A recording through a bag and back: every stamp, pixel and number where it was."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from vigauge.errors import DataError
from vigauge.recordings.asl.ground_truth import read_ground_truth
from vigauge.recordings.asl.images import read_image
from vigauge.recordings.asl.kalibr import camera_descriptions, imu_description
from vigauge.recordings.asl.rosbag import TRUTH_FOLDER, Topics, import_rosbag
from vigauge.recordings.asl.sequence import Sequence, read_sequence

START_NS = 1_600_000_000_123_456_789
SHIFT_NS = 2_500_000
TOPICS = Topics("/cam0/image_raw", "/cam1/image_raw", "/imu0", "/truth")
BIASES = np.array([0.01, 0.02, 0.03]), np.array([0.1, 0.2, 0.3])
R = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]


class WithoutAnchors(yaml.SafeDumper):
    """Kalibr writes every matrix out, also one that two cameras share."""

    def ignore_aliases(self, data: object) -> bool:
        return True


def kalibr_files(folder: Path, **changes: Any) -> tuple[Path, Path]:
    """camchain and imu.yaml; body to camera as Kalibr has it: x_C = R x_B + (0.05, 0.02, 0.01)."""
    camera = {
        "camera_model": "pinhole",
        "distortion_coeffs": [-0.28, 0.07, 2e-4, 1.7e-5],
        "distortion_model": "radtan",
        "intrinsics": [30.0, 31.0, 19.5, 14.5],
        "resolution": [40, 30],
        "timeshift_cam_imu": SHIFT_NS * 1e-9,
    }
    T_C0B = [[*R[0], 0.05], [*R[1], 0.02], [*R[2], 0.01], [0.0, 0.0, 0.0, 1.0]]
    T_C1C0 = [[1.0, 0.0, 0.0, -0.11], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    chain = {"cam0": camera | {"T_cam_imu": T_C0B} | changes, "cam1": camera | {"T_cn_cnm1": T_C1C0}}
    noise = {
        "gyroscope_noise_density": 1.7e-4,
        "gyroscope_random_walk": 2e-5,
        "accelerometer_noise_density": 2e-3,
        "accelerometer_random_walk": 3e-3,
        "update_rate": 200.0,
    }
    paths = folder / "camchain.yaml", folder / "imu.yaml"
    for path, content in zip(paths, (chain, noise), strict=True):
        path.write_text(yaml.dump(content, Dumper=WithoutAnchors))
    return paths


def picture(k: int, camera: int) -> np.ndarray:
    return np.random.default_rng(10 * camera + k).integers(0, 256, (30, 40), dtype=np.uint8)


@pytest.fixture(params=["ROS1_NOETIC", "ROS2_HUMBLE"])
def bag(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """4 stereo frames, 40 inertial samples, 20 poses; arrival times differ from the headers' stamps."""
    pytest.importorskip("rosbags")
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    ros1 = request.param.startswith("ROS1")
    store = get_typestore(Stores[request.param])
    types = {name.rsplit("/", 1)[1]: kind for name, kind in store.types.items()}
    types["Time"] = store.types["builtin_interfaces/msg/Time"]  # std_msgs of ROS 1 has another
    number = iter(range(1000))

    def header(t_ns: int) -> Any:
        stamp = types["Time"](sec=t_ns // 10**9, nanosec=t_ns % 10**9)
        extra = {"seq": next(number)} if ros1 else {}
        return types["Header"](stamp=stamp, frame_id="", **extra)

    def vector(*xyz: float) -> Any:
        return types["Vector3"](*xyz)

    rows: list[tuple[int, str, str, Any]] = []
    for k in range(4):
        t_ns = START_NS + 50_000_000 * k
        for camera, topic in enumerate((TOPICS.left, TOPICS.right)):
            image = types["Image"](
                header=header(t_ns),
                height=30,
                width=40,
                encoding="mono8",
                is_bigendian=0,
                step=48,
                data=np.pad(picture(k, camera), ((0, 0), (0, 8))).ravel(),
            )
            rows.append((t_ns, topic, "sensor_msgs/msg/Image", image))
    nine = np.zeros(9)
    for k in range(40):
        t_ns = START_NS + 5_000_000 * k
        sample = types["Imu"](
            header=header(t_ns),
            orientation=types["Quaternion"](0.0, 0.0, 0.0, 1.0),
            orientation_covariance=nine,
            angular_velocity=vector(0.1, -0.2, k / 100),
            angular_velocity_covariance=nine,
            linear_acceleration=vector(9.7, 0.4, 1 / 3),
            linear_acceleration_covariance=nine,
        )
        rows.append((t_ns, TOPICS.imu, "sensor_msgs/msg/Imu", sample))
    for k in range(20):
        t_ns = START_NS + 10_000_000 * k
        pose = types["Pose"](
            position=types["Point"](0.5 * k * 0.01, 1.0, 2.0),
            orientation=types["Quaternion"](0.6, 0.0, 0.0, 0.8),
        )
        message = types["PoseStamped"](header=header(t_ns), pose=pose)
        rows.append((t_ns, str(TOPICS.truth), "geometry_msgs/msg/PoseStamped", message))
    path = tmp_path / ("flight.bag" if ros1 else "flight")
    writer: Any = rosbag1.Writer(path) if ros1 else rosbag2.Writer(path, version=9)
    with writer:
        connections = {
            topic: writer.add_connection(topic, kind, typestore=store)
            for topic, kind in {(row[1], row[2]) for row in rows}
        }
        for t_ns, topic, kind, message in rows:
            raw = (store.serialize_ros1 if ros1 else store.serialize_cdr)(message, kind)
            writer.write(connections[topic], t_ns + 7_000_000, raw)
    return path


def convert(bag: Path, tmp_path: Path, topics: Topics = TOPICS) -> Sequence:
    camchain, imu_yaml = kalibr_files(tmp_path)
    import_rosbag(bag, topics, camchain, imu_yaml, tmp_path / "asl" / "flight", *BIASES)
    return read_sequence(tmp_path / "asl" / "flight")


def test_bag_becomes_the_recording_that_it_holds(bag: Path, tmp_path: Path) -> None:
    """Arrival times for stamps, a lost digit, padding in images, axes exchanged, an inverted T_BS."""
    sequence = convert(bag, tmp_path)
    assert sequence.frames.t_ns.tolist() == [START_NS + SHIFT_NS + 50_000_000 * k for k in range(4)]
    assert sequence.imu.t_ns.tolist() == [START_NS + 5_000_000 * k for k in range(40)]
    assert sequence.imu.gyro[7].tolist() == [0.1, -0.2, 0.07]
    assert sequence.imu.accel[7].tolist() == [9.7, 0.4, 1 / 3]
    for camera, paths in enumerate((sequence.frames.left, sequence.frames.right)):
        for k, path in enumerate(paths):
            assert np.array_equal(read_image(path, sequence.cameras[camera]), picture(k, camera))
    left, right = sequence.cameras
    np.testing.assert_allclose(left.R_BC, np.array(R).T)
    np.testing.assert_allclose(left.p_BC, -np.array(R).T @ [0.05, 0.02, 0.01], atol=1e-15)
    # The right camera sits 0.11 m along the left one's x axis.
    np.testing.assert_allclose(left.R_BC.T @ (right.p_BC - left.p_BC), [0.11, 0.0, 0.0], atol=1e-15)
    assert sequence.imu_noise.gyro_density == 1.7e-4


def test_truth_gets_velocities_and_known_biases(bag: Path, tmp_path: Path) -> None:
    convert(bag, tmp_path)
    truth = read_ground_truth(tmp_path / "asl" / "flight" / "mav0" / TRUTH_FOLDER)
    assert truth.v_W is not None and truth.gyro_bias is not None and truth.accel_bias is not None
    np.testing.assert_allclose(truth.v_W, np.tile([0.5, 0.0, 0.0], (20, 1)), atol=1e-12)
    assert truth.gyro_bias[3].tolist() == [0.01, 0.02, 0.03]
    assert truth.accel_bias[3].tolist() == [0.1, 0.2, 0.3]
    np.testing.assert_allclose(truth.R_WB[0] @ [0.0, 1.0, 0.0], [0.0, 0.28, 0.96], atol=1e-12)


def test_missing_topic_is_named_and_nothing_is_left(bag: Path, tmp_path: Path) -> None:
    with pytest.raises(DataError, match="must have the topic .*it has: /cam0/image_raw"):
        convert(bag, tmp_path, Topics("/left", TOPICS.right, TOPICS.imu))
    assert not list((tmp_path / "asl" / "flight").iterdir())


def test_recording_is_never_overwritten(bag: Path, tmp_path: Path) -> None:
    convert(bag, tmp_path)
    with pytest.raises(DataError, match="must not exist"):
        convert(bag, tmp_path)


def test_program_converts_and_refuses_in_one_line(bag: Path, tmp_path: Path) -> None:
    camchain, imu_yaml = kalibr_files(tmp_path)
    command = [sys.executable, "-m", "vigauge.cli.import_rosbag", "--camchain", str(camchain)]
    command += ["--imu-yaml", str(imu_yaml), "--output", str(tmp_path / "out"), "--truth", "/truth", "--bag"]
    done = subprocess.run([*command, str(bag)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "4 of /cam0/image_raw, 4 of /cam1/image_raw, 40 of /imu0, 20 of /truth" in done.stderr
    broken = tmp_path / "broken.bag"
    broken.write_bytes(b"#ROSBAG V2.0\nnothing else")
    command[command.index(str(tmp_path / "out"))] = str(tmp_path / "other")
    refused = subprocess.run([*command, str(broken)], capture_output=True, text=True, check=False)
    assert refused.returncode == 2, refused.stderr
    assert refused.stderr.startswith(f"error: {broken}: must be a readable bag")


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"camera_model": "omni"}, "cam0.camera_model"),
        ({"distortion_model": "equidistant"}, "cam0.distortion_model"),
        ({"T_cam_imu": [[1.0, 0.0], [0.0, 1.0]]}, "cam0.T_cam_imu"),
        ({"T_cam_imu": np.diag([1.0, 1.0, 2.0, 1.0]).tolist()}, "cam0.T_cam_imu"),
        ({"timeshift_cam_imu": 2.5e6}, "cam0.timeshift_cam_imu"),
    ],
)
def test_calibration_that_cannot_be_used_is_named(tmp_path: Path, changes: dict, field: str) -> None:
    """A fisheye read as a pinhole, or nanoseconds as seconds."""
    with pytest.raises(DataError) as caught:
        camera_descriptions(kalibr_files(tmp_path, **changes)[0])
    assert caught.value.field == field


def test_missing_density_is_named(tmp_path: Path) -> None:
    path = kalibr_files(tmp_path)[1]
    path.write_text("gyroscope_noise_density: 1.0e-3\n")
    with pytest.raises(DataError, match="gyroscope_random_walk: must be given"):
        imu_description(path)


def test_colour_images_become_grey() -> None:
    """Red read as blue."""
    from types import SimpleNamespace

    from vigauge.recordings.asl.rosbag import _grey

    colour = np.zeros((2, 3, 3), dtype=np.uint8)
    colour[:, :, 0] = 200
    message = SimpleNamespace(encoding="rgb8", height=2, width=3, step=9, data=colour.ravel())
    assert _grey("/left", message)[0, 0] == cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY)[0, 0] == 60
    message.encoding = "mono16"
    with pytest.raises(DataError, match="must be mono8"):
        _grey("/left", message)
