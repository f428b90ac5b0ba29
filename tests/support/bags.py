"""Rosbags of ROS 1 and 2, message by message."""

from collections.abc import Iterable, Sequence
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

# Stamp in ns, topic, message.
Row = tuple[int, str, Any]
# Messages arrive later than they are stamped.
_DELAY_NS = 7_000_000


class Messages:
    """Messages of one release of ROS (a name of ``rosbags.typesys.Stores``), and a bag of them."""

    def __init__(self, release: str = "ROS2_HUMBLE") -> None:
        pytest.importorskip("rosbags")
        from rosbags.typesys import Stores, get_typestore

        self.ros1 = release.startswith("ROS1")
        self.store = get_typestore(Stores[release])
        self.types = {name.rsplit("/", 1)[1]: kind for name, kind in self.store.types.items()}
        # std_msgs of ROS 1 has another.
        self.types["Time"] = self.store.types["builtin_interfaces/msg/Time"]
        self._number = count()

    def header(self, t_ns: int) -> Any:
        stamp = self.types["Time"](sec=t_ns // 10**9, nanosec=t_ns % 10**9)
        extra = {"seq": next(self._number)} if self.ros1 else {}
        return self.types["Header"](stamp=stamp, frame_id="", **extra)

    def image(self, t_ns: int, grey: np.ndarray, padding: int = 0) -> Any:
        """Grey levels (height, width); each row is padded by so many bytes."""
        height, width = grey.shape
        return self.types["Image"](
            header=self.header(t_ns),
            height=height,
            width=width,
            encoding="mono8",
            is_bigendian=0,
            step=width + padding,
            data=np.pad(grey, ((0, 0), (0, padding))).ravel(),
        )

    def imu(self, t_ns: int, gyro: Sequence[float], accel: Sequence[float]) -> Any:
        nine, vector = np.zeros(9), self.types["Vector3"]
        return self.types["Imu"](
            header=self.header(t_ns),
            orientation=self.types["Quaternion"](0.0, 0.0, 0.0, 1.0),
            orientation_covariance=nine,
            angular_velocity=vector(*map(float, gyro)),
            angular_velocity_covariance=nine,
            linear_acceleration=vector(*map(float, accel)),
            linear_acceleration_covariance=nine,
        )

    def pose(self, t_ns: int, p: Sequence[float], xyzw: Sequence[float]) -> Any:
        pose = self.types["Pose"](self.types["Point"](*p), self.types["Quaternion"](*xyzw))
        return self.types["PoseStamped"](header=self.header(t_ns), pose=pose)

    def write(self, path: Path, rows: Iterable[Row]) -> Path:
        """The bag: a file ``path``.bag of ROS 1, a folder of ROS 2."""
        from rosbags import rosbag1, rosbag2

        path = path.with_suffix(".bag") if self.ros1 else path
        writer: Any = rosbag1.Writer(path) if self.ros1 else rosbag2.Writer(path, version=9)
        connections: dict[tuple[str, str], Any] = {}
        with writer:
            for t_ns, topic, message in rows:
                kind = message.__msgtype__
                if (topic, kind) not in connections:
                    connections[topic, kind] = writer.add_connection(topic, kind, typestore=self.store)
                serialize = self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr
                writer.write(connections[topic, kind], t_ns + _DELAY_NS, serialize(message, kind))
        return path
