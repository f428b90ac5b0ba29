"""A rosbag (ROS 1 or 2) with one camera or a stereo pair and an inertial sensor, as an ASL folder.

Needs the `rosbags` package, which reads both without ROS: ``pip install rosbags``.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from ...errors import DataError
from ...geometry.so3 import Array
from .calibration import read_camera, read_imu_noise, unusual_densities
from .ground_truth import GroundTruth, read_ground_truth
from .kalibr import CameraChain, camera_chain, imu_description
from .messages import grey, inertial, messages, pose
from .nearest import nearest_index
from .sequence import STEREO_TOLERANCE_NS

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
    """Names of topics: images (``right`` None: one camera), inertial sensor, and true poses of the body."""

    left: str
    right: str | None
    imu: str
    truth: str | None = None

    @property
    def images(self) -> list[str]:
        """Of the left camera and, where there is one, of the right one."""
        return [self.left, *([self.right] if self.right is not None else [])]

    @property
    def wanted(self) -> list[str]:
        """All of them; truth last."""
        return [*self.images, self.imu, *([self.truth] if self.truth is not None else [])]


@dataclass(frozen=True)
class Imported:
    """How many messages each topic gave, and sentences on what did not go in as it stands."""

    counts: dict[str, int]
    notes: tuple[str, ...]


def import_rosbag(
    bag: Path,
    topics: Topics,
    camchain: Path,
    imu_yaml: Path,
    folder: Path,
    gyro_bias: Array | None = None,
    accel_bias: Array | None = None,
) -> Imported:
    """Write ``folder/mav0`` from a bag and Kalibr's calibration.

    Stamps are those of the messages' headers, by the sensors' clock; camera stamps are moved by
    Kalibr's ``timeshift_cam_imu``. Truth gets velocities by central differences and the constant
    biases (3,) rad/s and (3,) m/s^2, which the front-end takes as known; without a truth there
    are none.

    Raises
    ------
    DataError
        for a missing package, bag, topic or message type, an image that is damaged or not 8-bit
        grey or colour, a stamp that is zero or given twice, cameras that are not triggered
        together, a truth without biases or with few poses, calibration that is not used, and for
        a folder that is there already.
    """
    if (folder / "mav0").exists():
        raise DataError(folder / "mav0", "must not exist: recordings are never overwritten")
    biases = _known_biases(bag, topics, gyro_bias, accel_bias)
    chain = camera_chain(camchain)
    noise, notes = imu_description(imu_yaml)
    _check_topics(bag, topics, camchain, chain)
    folder.mkdir(parents=True, exist_ok=True)
    temporary = folder / f".mav0.{os.getpid()}"
    try:
        cameras = [f"cam{k}" for k in range(len(topics.images))]
        for name, description in zip([*cameras, "imu0"], [*chain.descriptions, noise], strict=True):
            (temporary / name).mkdir(parents=True)
            text = yaml.safe_dump(description, sort_keys=False)
            (temporary / name / "sensor.yaml").write_text(text, encoding="utf-8")
        for name in cameras:
            with _naming(camchain, name):
                read_camera(temporary / name / "sensor.yaml")
        with _naming(imu_yaml):
            densities = read_imu_noise(temporary / "imu0" / "sensor.yaml")
        notes = (*chain.notes, *notes, *(f"{imu_yaml}, {words}" for words in unusual_densities(densities)))
        done = _write_messages(bag, topics, temporary, chain)
        if topics.truth is not None and biases is not None:
            with _naming(bag, topics.truth):
                _add_states(temporary / TRUTH_FOLDER, biases)
        temporary.rename(folder / "mav0")
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return Imported(done.counts, (*notes, *done.notes))


@contextmanager
def _naming(file: Path, where: str = "") -> Iterator[None]:
    """Errors about a file that is written on the way name what the user gave instead."""
    try:
        yield
    except DataError as error:
        field = ", ".join(part for part in (where, error.field) if part)
        raise DataError(file, error.rule, field=field or None, value=error.value) from error


def _known_biases(
    bag: Path, topics: Topics, gyro_bias: Array | None, accel_bias: Array | None
) -> Array | None:
    """(6,) biases beside a truth, or None without one; DataError where it would be guessed or dropped."""
    if topics.truth is None:
        if gyro_bias is not None or accel_bias is not None:
            raise DataError(bag, "biases are written beside a truth: give its topic too, or no biases")
        return None
    if gyro_bias is None or accel_bias is None:
        rule = (
            "a truth needs the sensor's biases, which are taken as known: give both --gyro-bias and "
            "--accel-bias (three zeros each, if it has none)"
        )
        raise DataError(bag, rule, field=topics.truth)
    biases = np.concatenate([np.asarray(gyro_bias, dtype=float), np.asarray(accel_bias, dtype=float)])
    if biases.shape != (6,) or not np.all(np.isfinite(biases)):
        raise DataError(bag, "biases must be three finite numbers each", value=biases.tolist())
    return biases


def _check_topics(bag: Path, topics: Topics, camchain: Path, chain: CameraChain) -> None:
    """No topic twice, one for each calibrated camera, and no camera with the calibration of the other."""
    for topic in topics.wanted:
        if topics.wanted.count(topic) > 1:
            raise DataError(bag, "topics must differ: each sensor has its own", value=topic)
    if len(topics.images) != len(chain.descriptions):
        rule = "must be there where a right topic is given, and not where none is: one camera is cam0 alone"
        raise DataError(camchain, rule, field="cam1", value=topics.right)
    for k, (given, other) in enumerate(zip(topics.images, topics.images[::-1], strict=True)):
        if given != other and chain.topics[k] == other:
            rule = f"must not be the other camera's topic: this is calibrated for it, and {given} was given"
            raise DataError(camchain, rule, field=f"cam{k}.rostopic", value=other)


def _write_messages(bag: Path, topics: Topics, mav: Path, chain: CameraChain) -> Imported:
    """Images as they come, one after the other; the few numbers of the other sensors at the end."""
    camera_of = {topic: k for k, topic in enumerate(topics.images)}
    stamps: dict[str, list[int]] = {topic: [] for topic in topics.wanted}
    images: dict[str, set[int]] = {topic: set() for topic in camera_of}
    rows: dict[str, list[tuple[int, list[float]]]] = {topic: [] for topic in topics.wanted[len(camera_of) :]}
    for topic, message in messages(bag, topics.wanted):
        t_ns = message.header.stamp.sec * _NS + message.header.stamp.nanosec
        stamps[topic].append(t_ns)
        if topic in camera_of:
            t_ns += chain.shifts_ns[camera_of[topic]]
        if t_ns <= 0 or stamps[topic][-1] == 0:
            rule = f"headers must have the sensor's stamps, not zero (message {len(stamps[topic])})"
            raise DataError(bag, rule, field=topic, value=t_ns)
        if topic not in camera_of:
            numbers = inertial if topic == topics.imu else pose
            rows[topic].append((t_ns, numbers(bag, topic, message)))
            continue
        if t_ns in images[topic]:
            raise DataError(bag, "two images must not have one stamp", field=topic, value=t_ns)
        images[topic].add(t_ns)
        width, height = chain.descriptions[camera_of[topic]]["resolution"]
        image = grey(bag, topic, message)
        if image.shape != (height, width):
            rule = f"images must have the size in the camchain, {width} x {height}"
            raise DataError(bag, rule, field=topic, value=f"{image.shape[1]} x {image.shape[0]}")
        _write_image(mav / f"cam{camera_of[topic]}" / "data" / f"{t_ns}.png", image)
    frames = [np.array(sorted(images[topic]), dtype=np.int64) for topic in camera_of]
    _check_frames(bag, topics, chain, frames)
    for k, times in enumerate(frames):
        lines = ["#timestamp [ns],filename", *(f"{t},{t}.png" for t in times)]
        (mav / f"cam{k}" / "data.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    _write_table(mav / "imu0" / "data.csv", IMU_HEADER, rows[topics.imu])
    if topics.truth:
        _write_table(mav / TRUTH_FOLDER / "data.csv", TRUTH_HEADER, rows[topics.truth])
    late = {
        topic: sum(t < latest for t, latest in zip(times, accumulate(times, max), strict=True))
        for topic, times in stamps.items()
    }
    notes = [
        f"{topic}: {n} message(s) came after a later one and are sorted" for topic, n in late.items() if n
    ]
    return Imported({topic: len(times) for topic, times in stamps.items()}, tuple(notes))


def _check_frames(bag: Path, topics: Topics, chain: CameraChain, frames: list[NDArray[np.int64]]) -> None:
    """DataError where a camera has no frames, or most of a pair's have no partner at the same time."""
    for topic, times in zip(topics.images, frames, strict=True):
        if len(times) == 0:
            raise DataError(bag, "topic must have messages", value=topic)
    if len(frames) == 1:
        return
    left, right = frames
    _, distance = nearest_index(right, left)
    paired, whole = int(np.sum(distance <= STEREO_TOLERANCE_NS)), min(len(left), len(right))
    if 2 * paired < whole:
        rule = (
            f"frames of {topics.left} and {topics.right} must have equal stamps once their "
            f"timeshift_cam_imu ({chain.shifts_ns[0]} and {chain.shifts_ns[1]} ns) are added: "
            "the cameras must be triggered together"
        )
        raise DataError(bag, rule, value=f"{paired} pairs of {whole}")


def _write_image(path: Path, image: NDArray[np.uint8]) -> None:
    path.parent.mkdir(exist_ok=True)
    done, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    if not done:
        raise DataError(path, "image must be writable")
    path.write_bytes(data.tobytes())


def _write_table(path: Path, header: str, rows: list[tuple[int, list[float]]]) -> None:
    path.parent.mkdir(exist_ok=True)
    lines = (f"{t},{','.join(repr(float(x)) for x in values)}" for t, values in sorted(rows))
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")


def _add_states(folder: Path, known_biases: Array) -> None:
    """Velocities and biases beside the poses of a truth, as 17 columns."""
    truth: GroundTruth = read_ground_truth(folder)
    if len(truth.t_ns) < 3:
        raise DataError(folder / "data.csv", "must have at least three poses", value=len(truth.t_ns))
    v_W = np.gradient(truth.p_W, (truth.t_ns - truth.t_ns[0]) * 1e-9, axis=0, edge_order=2)
    lines = (folder / "data.csv").read_text(encoding="utf-8").splitlines()[1:]
    biases = ",".join(repr(float(x)) for x in known_biases)
    rows = (
        f"{line},{','.join(repr(x) for x in v)},{biases}" for line, v in zip(lines, v_W.tolist(), strict=True)
    )
    (folder / "data.csv").write_text("\n".join([STATE_HEADER, *rows]) + "\n", encoding="utf-8")
