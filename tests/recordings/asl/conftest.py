"""A small, valid ASL folder, ready to be spoilt."""

from pathlib import Path

import pytest

from support.asl import IMU_NS, write_sequence


@pytest.fixture
def sequence_folder(tmp_path: Path) -> Path:
    """A sequence of 4 stereo frames and 40 inertial samples."""
    return write_sequence(tmp_path / "flight")


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
