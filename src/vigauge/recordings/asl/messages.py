"""Messages of a rosbag (ROS 1 or 2), and the images, samples and poses in them.

Needs the `rosbags` package, which reads both without ROS: ``pip install rosbags``.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...errors import DataError
from .images import decode_image


def messages(bag: Path, wanted: list[str]) -> Iterator[tuple[str, Any]]:
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


def grey(bag: Path, topic: str, message: Any) -> NDArray[np.uint8]:
    """(height, width) 8-bit grey image of an Image or a CompressedImage."""
    if hasattr(message, "format"):
        image = decode_image(bytes(message.data), str(bag), topic)
        return image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    if not hasattr(message, "encoding"):
        raise DataError(bag, "must be Image or CompressedImage", field=topic, value=type(message).__name__)
    encoding = message.encoding.lower()
    channels = {"mono8": 1, "8uc1": 1, "bgr8": 3, "8uc3": 3, "rgb8": 3}.get(encoding)
    if channels is None:
        raise DataError(bag, "must be mono8, bgr8 or rgb8", field=f"{topic}.encoding", value=message.encoding)
    data = np.frombuffer(message.data, np.uint8)
    if len(data) != message.height * message.step or message.step < message.width * channels:
        raise DataError(bag, "must have height * step bytes", field=f"{topic}.data", value=len(data))
    rows = data.reshape(message.height, message.step)[:, : message.width * channels]
    if channels == 1:
        return rows
    colour = rows.reshape(message.height, message.width, 3)
    return cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY if encoding == "rgb8" else cv2.COLOR_BGR2GRAY)


def inertial(bag: Path, topic: str, message: Any) -> list[float]:
    """Angular velocity and specific force of an Imu."""
    if not hasattr(message, "angular_velocity"):
        raise DataError(bag, "must be Imu", field=topic, value=type(message).__name__)
    w, a = message.angular_velocity, message.linear_acceleration
    return [w.x, w.y, w.z, a.x, a.y, a.z]


def pose(bag: Path, topic: str, message: Any) -> list[float]:
    """Position and quaternion, w first, of a PoseStamped, Odometry or TransformStamped."""
    if hasattr(message, "transform"):
        p, q = message.transform.translation, message.transform.rotation
    elif hasattr(message, "pose"):
        given = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        p, q = given.position, given.orientation
    else:
        rule = "must be PoseStamped, Odometry or TransformStamped"
        raise DataError(bag, rule, field=topic, value=type(message).__name__)
    return [p.x, p.y, p.z, q.w, q.x, q.y, q.z]
