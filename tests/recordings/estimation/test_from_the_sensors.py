"""From a bag or a folder to an estimate, as a user goes: import, check, estimate; then against the truth."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

import vigauge as vg
from support.bags import Messages, Row
from support.uniform_motion import render_uniform_motion
from vigauge.cli import check_sequence, estimate, import_rosbag
from vigauge.geometry import so3
from vigauge.model.evaluation import align_first_pose
from vigauge.model.state import State
from vigauge.recordings.asl.ground_truth import GroundTruth, read_ground_truth
from vigauge.recordings.asl.sequence import Sequence, read_sequence

FILES = {
    "page.html",
    "trajectory.tum",
    "trajectory.csv",
    "trajectory.npz",
    "biases.csv",
    "problem.npz",
    "summary.json",
}


def command(monkeypatch: pytest.MonkeyPatch, main: Callable[[], None], *arguments: object) -> int:
    """Exit status of a command, run in this process."""
    monkeypatch.setattr(sys, "argv", ["vigauge", *map(str, arguments)])
    try:
        main()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def bag_of(sequence: Sequence, folder: Path) -> Path:
    """The recording as a bag, and Kalibr's two files beside it."""
    messages = Messages()
    cameras = list(zip(sequence.cameras, (sequence.frames.left, sequence.frames.right), strict=False))
    rows: list[Row] = []
    for k, (_, paths) in enumerate(cameras):
        for t_ns, path in zip(sequence.frames.t_ns.tolist(), paths, strict=True):
            image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
            rows.append((t_ns, f"/cam{k}/image_raw", messages.image(t_ns, image)))
    imu = zip(sequence.imu.t_ns.tolist(), sequence.imu.gyro, sequence.imu.accel, strict=True)
    rows += [(t_ns, "/imu0", messages.imu(t_ns, gyro, accel)) for t_ns, gyro, accel in imu]
    chain = {
        f"cam{k}": {
            "camera_model": "pinhole",
            "intrinsics": [camera.fx, camera.fy, camera.cx, camera.cy],
            "distortion_model": "radtan",
            "distortion_coeffs": list(camera.distortion),
            "resolution": [camera.width, camera.height],
            "T_cam_imu": np.linalg.inv(camera.T_BC).tolist(),
        }
        for k, (camera, _) in enumerate(cameras)
    }
    noise = sequence.imu_noise
    densities = {
        "gyroscope_noise_density": noise.gyro_density,
        "gyroscope_random_walk": noise.gyro_walk,
        "accelerometer_noise_density": noise.accel_density,
        "accelerometer_random_walk": noise.accel_walk,
    }
    for name, content in (("camchain.yaml", chain), ("imu.yaml", densities)):
        (folder / name).write_text(yaml.safe_dump(content), encoding="utf-8")
    return messages.write(folder / "flight_bag", sorted(rows, key=lambda row: row[0]))


def in_sigmas(problem: vg.Problem, truth: GroundTruth, t_ns: np.ndarray) -> dict[str, float]:
    """RMS of the errors of a solved problem next to their sigmas, of each kind; first poses joined."""
    state, row = problem.initial, truth.nearest(t_ns)
    true = State.start(truth.p_W[row], truth.R_WB[row], truth.v_W[row], np.zeros((0, 3)))
    true = align_first_pose(true, state)
    errors = {
        "position": state.p_W - true.p_W,
        "rotation": so3.log(state.R_WB @ true.R_WB.swapaxes(1, 2)),
        "velocity": state.v_W - true.v_W,
        "gyroscope": state.gyro_bias - truth.gyro_bias[row],
        "accelerometer": state.accel_bias - truth.accel_bias[row],
    }
    blocks = vg.Covariance.of(problem, state).keyframes(vg.FixedGauge())
    sigma = np.sqrt(np.diagonal(blocks, axis1=1, axis2=2)).reshape(len(row), 5, 3)
    return {
        # Of the first keyframe the gauge holds some.
        name: float(np.sqrt(np.mean((error[1:] / sigma[1:, k]) ** 2)))
        for k, (name, error) in enumerate(errors.items())
    }


# The most that errors of a kind may be of their sigmas: of one recording they are far from independent.
MOST = 3.0


@pytest.mark.parametrize("kind", ["bag", "bag of one camera", "fisheye", "turning on the spot"])
def test_from_the_sensors_to_the_truth(
    kind: str, rendered, request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An axis, a clock or a camera that is lost on the way; sigmas that say nothing of the errors."""
    source, flight = rendered.folder, tmp_path / "flight"
    if kind == "fisheye":
        source = request.getfixturevalue("fisheye_folder")
    elif kind == "turning on the spot":
        source = render_uniform_motion(tmp_path / "turning", np.zeros(3))
    ignore = shutil.ignore_patterns("state_groundtruth_*", "cam1" if kind == "bag of one camera" else "")
    shutil.copytree(source, tmp_path / "source", copy_function=os.link, ignore=ignore)
    if "bag" not in kind:
        flight = tmp_path / "source"
    else:
        bag = bag_of(read_sequence(tmp_path / "source"), tmp_path)
        files = {"bag": bag, "camchain": tmp_path / "camchain.yaml", "imu-yaml": tmp_path / "imu.yaml"}
        flags = [part for name, path in files.items() for part in (f"--{name}", path)]
        assert command(monkeypatch, import_rosbag.main, *flags, "--output", flight) == 0
    assert command(monkeypatch, check_sequence.main, flight) == 0
    out = tmp_path / "out"
    assert command(monkeypatch, estimate.main, flight, "--keyframes", 7, "--out", out) == 0
    assert {path.name for path in out.iterdir()} == FILES
    (problem,) = vg.load_problems(out / "problem.npz")
    truth = read_ground_truth(source / "mav0" / "state_groundtruth_estimate0")
    found = in_sigmas(problem, truth, vg.load_trajectory(out / "trajectory.tum").times_ns)
    assert max(found.values()) < MOST, found
    # And sigmas are none that anything would fit into.
    assert max(found.values()) > 0.3
