"""Turn a rosbag (ROS 1 or 2) and Kalibr's calibration into an ASL folder.

Needs the package rosbags, which reads bags without ROS: pip install rosbags.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from vigauge.cli.command import LOG, parser, run
from vigauge.recordings.asl.kalibr import camera_chain
from vigauge.recordings.asl.rosbag import Topics, import_rosbag

_RIGHT = "/cam1/image_raw"


def work(options: argparse.Namespace) -> None:
    right = options.right
    if right is None and len(camera_chain(options.camchain).descriptions) == 2:
        right = _RIGHT
    topics = Topics(options.left, right, options.imu, options.truth)
    done = import_rosbag(
        options.bag,
        topics,
        options.camchain,
        options.imu_yaml,
        options.output,
        options.gyro_bias,
        options.accel_bias,
    )
    for note in done.notes:
        LOG.warning("warning: %s", note)
    LOG.info("%s: %s", options.output, ", ".join(f"{n} of {topic}" for topic, n in done.counts.items()))


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument(
        "--bag", type=Path, required=True, help="bag: a file of ROS 1 or a folder of ROS 2"
    )
    arguments.add_argument("--left", default="/cam0/image_raw", help="topic of the left image")
    arguments.add_argument(
        "--right", help=f"topic of the right image; default: {_RIGHT}, or none where the camchain has no cam1"
    )
    arguments.add_argument("--imu", default="/imu0", help="topic of the inertial sensor")
    arguments.add_argument("--truth", help="topic of the body's true poses")
    arguments.add_argument("--camchain", type=Path, required=True, help="Kalibr's camchain-imucam.yaml")
    arguments.add_argument("--imu-yaml", type=Path, required=True, help="Kalibr's imu.yaml")
    for name, unit in (("gyro", "rad/s"), ("accel", "m/s^2")):
        arguments.add_argument(
            f"--{name}-bias",
            type=float,
            nargs=3,
            metavar=("X", "Y", "Z"),
            help=f"known bias in {unit}; needed with --truth",
        )
    arguments.add_argument("--output", type=Path, required=True, help="folder to put mav0/ into")
    run(work, arguments)


if __name__ == "__main__":
    main()
