"""Ground truth of 8 and 17 columns, its quaternion order, and look-ups by nearness."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from support.asl import IMU_NS
from vigauge.errors import DataError
from vigauge.recordings.asl.ground_truth import read_ground_truth


def change(folder: Path, old: str, new: str, count: int = -1) -> None:
    path = folder / "data.csv"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, count))


def test_seventeen_columns_are_all_read(truth_folder):
    """Catches blocks read in another order, and a quaternion taken with w last."""
    truth = read_ground_truth(truth_folder)
    assert truth.t_ns.tolist() == IMU_NS
    assert truth.p_W[7].tolist() == [1.0, 2.0, 3.0]
    assert truth.v_W is not None and truth.v_W[7].tolist() == [0.1, 0.2, 0.3]
    assert truth.gyro_bias is not None and truth.gyro_bias[7].tolist() == [0.01, 0.02, 0.03]
    assert truth.accel_bias is not None and truth.accel_bias[7].tolist() == [-0.1, -0.2, -0.3]
    # q = (w, x, y, z) = (1, 1, -1, 1) / 2 turns by 120 degrees about (1, -1, 1): x to z, y to -x, z to -y.
    assert np.allclose(truth.R_WB[7].T, [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], rtol=0, atol=1e-15)


def test_eight_columns_have_poses_only(truth_folder):
    """Catches zeros made up for velocities and biases that the file does not have."""
    path = truth_folder / "data.csv"
    path.write_text("\n".join(",".join(line.split(",")[:8]) for line in path.read_text().splitlines()))
    truth = read_ground_truth(truth_folder)
    assert len(truth.p_W) == len(IMU_NS)
    assert truth.v_W is truth.gyro_bias is truth.accel_bias is None


@pytest.mark.parametrize("n_columns", [7, 9, 16])
def test_other_numbers_of_columns_are_refused(truth_folder, n_columns):
    path = truth_folder / "data.csv"
    path.write_text(
        "\n".join(",".join(line.split(",")[:n_columns]) for line in path.read_text().splitlines())
    )
    with pytest.raises(DataError, match=r"data.csv, row 2: must have 8 or 17 columns"):
        read_ground_truth(truth_folder)


def test_quaternion_with_w_last_is_refused_by_its_header(truth_folder):
    """Catches x y z w, which has unit length and turns every orientation."""
    change(truth_folder, "qw,qx,qy,qz", "qx,qy,qz,qw")
    with pytest.raises(DataError, match="w first"):
        read_ground_truth(truth_folder)


def test_quaternion_off_unit_length_names_the_line(truth_folder):
    change(truth_folder, f"{IMU_NS[3]},1,2,3,0.5", f"{IMU_NS[3]},1,2,3,0.51")
    with pytest.raises(DataError, match="unit length") as caught:
        read_ground_truth(truth_folder)
    assert caught.value.row == 5


def test_rounded_quaternion_becomes_an_exact_rotation(truth_folder):
    """Catches rotation matrices off by the six digits of published truth."""
    change(truth_folder, "0.5,0.5,-0.5,0.5", "0.5002,0.5,-0.5,0.5")
    R_WB = read_ground_truth(truth_folder).R_WB
    assert np.abs(R_WB @ R_WB.swapaxes(1, 2) - np.eye(3)).max() < 1e-15


def test_missing_truth_folder_is_named(tmp_path):
    with pytest.raises(DataError, match="file must exist"):
        read_ground_truth(tmp_path / "state_groundtruth_nowhere")


def test_look_up_takes_the_nearest_and_refuses_the_far(truth_folder):
    """Catches equality, which loses stamps off by 256 ns, and a state from elsewhere taken in silence."""
    truth = read_ground_truth(truth_folder)
    wanted = np.array([IMU_NS[0] - 256, IMU_NS[3] + 256, IMU_NS[-1]])
    assert truth.nearest(wanted).tolist() == [0, 3, len(IMU_NS) - 1]
    assert truth.nearest([IMU_NS[1] + 2_400_000], max_distance_ns=2_500_000).tolist() == [1]
    beyond = IMU_NS[-1] + 1_000_001
    with pytest.raises(DataError, match="within 1000000 ns") as caught:
        truth.nearest([IMU_NS[0], beyond])
    assert (caught.value.row, caught.value.value) == (1, beyond)
    assert caught.value.file == str(truth_folder / "data.csv")
