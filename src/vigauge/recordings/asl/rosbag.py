"""A rosbag (ROS 1 or 2) with a stereo pair and an inertial sensor, as an ASL folder.

Needs the `rosbags` package, which reads both without ROS: ``pip install rosbags``.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from ...errors import DataError
from ...geometry.so3 import Array
from .calibration import read_camera, read_imu_noise
from .ground_truth import GroundTruth, read_ground_truth
from .kalibr import camera_descriptions, imu_description

IMU_HEADER = (
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]"
)
TRUTH_HEADER = "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w [],q_x [],q_y [],q_z []"
STATE_HEADER = (
    TRUTH_HEADER
    + ",v_x [m s^-1],v_y [m s^-1],v_z [m s^-1],b_w_x [rad s^-1],b_w_y [rad s^-1],b_w_z [rad s^-1],"
    "b_a_x [m s^-2],b_a_y [m s^-2],b_a_z [m s^-2]"
)
TRUTH_FOLDER = "state_groundtruth_estimate0"
_NS = 1_000_000_000


@dataclass(frozen=True)
class Topics:
    """Names of topics: two images, one inertial sensor, and poses of the body for truth (or None)."""

    left: str
    right: str
    imu: str
    truth: str | None = None


def import_rosbag(
    bag: Path,
    topics: Topics,
    camchain: Path,
    imu_yaml: Path,
    folder: Path,
    gyro_bias: Array,
    accel_bias: Array,
) -> dict[str, int]:
    """Write ``folder/mav0`` from a bag and Kalibr's calibration; how many messages each topic gave.

    Stamps are those of the messages' headers, by the sensors' clock; camera stamps are moved by
    Kalibr's ``timeshift_cam_imu``. Truth gets velocities by central differences and the constant
    biases (3,) rad/s and (3,) m/s^2, which the front-end takes as known.

    Raises
    ------
    DataError
        for a missing package, bag, topic or message type, an image that is not 8-bit grey or
        colour, a truth whose poses are too few, and for a folder that is there already.
    """
    if (folder / "mav0").exists():
        raise DataError(folder / "mav0", "must not exist: recordings are never overwritten")
    cameras, shift_ns = camera_descriptions(camchain)
    noise = imu_description(imu_yaml)
    folder.mkdir(parents=True, exist_ok=True)
    temporary = folder / f".mav0.{os.getpid()}"
    try:
        for name, description in zip(("cam0", "cam1", "imu0"), (*cameras, noise), strict=True):
            (temporary / name).mkdir(parents=True)
            text = yaml.safe_dump(description, sort_keys=False)
            (temporary / name / "sensor.yaml").write_text(text, encoding="utf-8")
        read_camera(temporary / "cam0" / "sensor.yaml")
        read_camera(temporary / "cam1" / "sensor.yaml")
        read_imu_noise(temporary / "imu0" / "sensor.yaml")
        counts = _write_messages(bag, topics, temporary, shift_ns)
        if topics.truth is not None:
            _add_states(temporary / TRUTH_FOLDER, gyro_bias, accel_bias)
        temporary.rename(folder / "mav0")
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return counts


def _write_messages(bag: Path, topics: Topics, mav: Path, shift_ns: int) -> dict[str, int]:
    """Images as they come, one after the other; the few numbers of the other sensors at the end."""
    camera_of = {topics.left: "cam0", topics.right: "cam1"}
    wanted = [topics.left, topics.right, topics.imu, *([topics.truth] if topics.truth else [])]
    counts = dict.fromkeys(wanted, 0)
    stamps: dict[str, list[int]] = {name: [] for name in camera_of.values()}
    inertial: list[tuple[int, list[float]]] = []
    poses: list[tuple[int, list[float]]] = []
    for topic, message in _messages(bag, wanted):
        counts[topic] += 1
        t_ns = message.header.stamp.sec * _NS + message.header.stamp.nanosec
        if topic in camera_of:
            name, t_ns = camera_of[topic], t_ns + shift_ns
            _write_image(mav / name / "data" / f"{t_ns}.png", _grey(topic, message))
            stamps[name].append(t_ns)
        elif topic == topics.imu:
            w, a = message.angular_velocity, message.linear_acceleration
            inertial.append((t_ns, [w.x, w.y, w.z, a.x, a.y, a.z]))
        else:
            poses.append((t_ns, _pose(topic, message)))
    for name, times in stamps.items():
        lines = ["#timestamp [ns],filename", *(f"{t},{t}.png" for t in sorted(times))]
        (mav / name / "data.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    _write_table(mav / "imu0" / "data.csv", IMU_HEADER, inertial)
    if topics.truth:
        _write_table(mav / TRUTH_FOLDER / "data.csv", TRUTH_HEADER, poses)
    return counts


def _messages(bag: Path, wanted: list[str]) -> Iterator[tuple[str, Any]]:
    """(topic, message) of the wanted topics in the order of the bag."""
    try:
        from rosbags import rosbag1, rosbag2
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.serde import SerdeError
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise DataError(bag, "needs the package rosbags: pip install rosbags") from error
    if not bag.exists():
        raise DataError(bag, "bag must exist")
    try:
        # ROS 2 bags may lack the definitions of their messages; the common ones are the same in all of them.
        with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            for topic in wanted:
                if topic not in reader.topics:
                    known = ", ".join(sorted(reader.topics))
                    raise DataError(bag, f"must have the topic (it has: {known})", value=topic)
            chosen = [connection for connection in reader.connections if connection.topic in wanted]
            for connection, _, raw in reader.messages(connections=chosen):
                yield connection.topic, reader.deserialize(raw, connection.msgtype)
    except (AnyReaderError, rosbag1.ReaderError, rosbag2.ReaderError, SerdeError) as error:
        raise DataError(bag, f"must be a readable bag: {error}") from error


def _grey(topic: str, message: Any) -> NDArray[np.uint8]:
    """(height, width) 8-bit grey image of an Image or a CompressedImage."""
    if hasattr(message, "format"):
        image = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_GRAYSCALE)
        if image is None:
            raise DataError(topic, "must hold images that OpenCV can decode", value=message.format)
        return image
    encoding = message.encoding.lower()
    channels = {"mono8": 1, "8uc1": 1, "bgr8": 3, "8uc3": 3, "rgb8": 3}.get(encoding)
    if channels is None:
        raise DataError(topic, "must be mono8, bgr8 or rgb8", field="encoding", value=message.encoding)
    data = np.frombuffer(message.data, np.uint8)
    if len(data) != message.height * message.step or message.step < message.width * channels:
        raise DataError(topic, "must have height * step bytes", field="data", value=len(data))
    rows = data.reshape(message.height, message.step)[:, : message.width * channels]
    if channels == 1:
        return rows
    colour = rows.reshape(message.height, message.width, 3)
    return cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY if encoding == "rgb8" else cv2.COLOR_BGR2GRAY)


def _write_image(path: Path, image: NDArray[np.uint8]) -> None:
    path.parent.mkdir(exist_ok=True)
    done, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    if not done:
        raise DataError(path, "image must be writable")
    path.write_bytes(data.tobytes())


def _pose(topic: str, message: Any) -> list[float]:
    """Position and quaternion, w first, of a PoseStamped, Odometry or TransformStamped."""
    if hasattr(message, "transform"):
        p, q = message.transform.translation, message.transform.rotation
    elif hasattr(message, "pose"):
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        p, q = pose.position, pose.orientation
    else:
        raise DataError(
            topic, "must be PoseStamped, Odometry or TransformStamped", value=type(message).__name__
        )
    return [p.x, p.y, p.z, q.w, q.x, q.y, q.z]


def _write_table(path: Path, header: str, rows: list[tuple[int, list[float]]]) -> None:
    path.parent.mkdir(exist_ok=True)
    lines = (f"{t},{','.join(repr(float(x)) for x in values)}" for t, values in sorted(rows))
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")


def _add_states(folder: Path, gyro_bias: Array, accel_bias: Array) -> None:
    """Velocities and biases beside the poses of a truth, as 17 columns."""
    truth: GroundTruth = read_ground_truth(folder)
    if len(truth.t_ns) < 3:
        raise DataError(folder / "data.csv", "must have at least three poses", value=len(truth.t_ns))
    v_W = np.gradient(truth.p_W, (truth.t_ns - truth.t_ns[0]) * 1e-9, axis=0, edge_order=2)
    lines = (folder / "data.csv").read_text(encoding="utf-8").splitlines()[1:]
    biases = ",".join(repr(float(x)) for x in np.concatenate([gyro_bias, accel_bias]))
    rows = (
        f"{line},{','.join(repr(x) for x in v)},{biases}" for line, v in zip(lines, v_W.tolist(), strict=True)
    )
    (folder / "data.csv").write_text("\n".join([STATE_HEADER, *rows]) + "\n", encoding="utf-8")
