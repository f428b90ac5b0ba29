"""Ground truth of 8 and 17 columns, its quaternion order, and look-ups by nearness."""

from pathlib import Path

import numpy as np
import pytest

from support.asl import IMU_NS
from vigauge.errors import DataError
from vigauge.geometry import so3
from vigauge.recordings.asl.ground_truth import LARGEST_GAP_NS, GroundTruth, read_ground_truth


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


def motion(t_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, rotation and velocity of lively motion, in closed form."""
    t = (t_ns - IMU_NS[0])[:, None] * 1e-9
    rate = np.array([2.0, 3.0, 1.0])
    R_WB = so3.exp(np.sin(2.0 * t) * [0.0, 0.0, 1.0])
    return np.sin(rate * t), R_WB, rate * np.cos(rate * t)


@pytest.mark.parametrize("spacing_ms", [5, 10, 50])
def test_states_between_samples_are_interpolated(spacing_ms):
    """Catches the state of the nearest sample, off by half a spacing of motion: 5 mm and more at 1 m/s."""
    t_ns = IMU_NS[0] + np.arange(2000 // spacing_ms, dtype=np.int64) * spacing_ms * 1_000_000
    p_W, R_WB, v_W = motion(t_ns)
    truth = GroundTruth(t_ns, p_W, R_WB, v_W)
    wanted = IMU_NS[0] + np.array([0, 256, 313_000_000, 800_000_000 + spacing_ms * 500_000, 1_702_345_678])
    state = truth.states_at(wanted)
    p, R, v = motion(wanted)
    # A straight line misses by the second derivative times an eighth of the squared spacing; the cubic less.
    miss = (1e-3 * spacing_ms) ** 2 / 8.0
    assert np.abs(state.p_W - p).max() < miss
    assert np.abs(so3.log(R.swapaxes(1, 2) @ state.R_WB)).max() < 5.0 * miss
    assert np.abs(state.v_W - v).max() < 28.0 * miss
    # Stamps of the same instant get the row itself, whatever they were rounded to.
    assert np.array_equal(state.p_W[:2], truth.p_W[[0, 0]])


def test_velocities_of_a_truth_with_poses_only_are_derived():
    """Catches zeros for velocities, and those next to a hole or the ends, which no difference can tell."""
    t_ns = IMU_NS[0] + np.arange(240, dtype=np.int64) * 8_333_333
    t_ns = np.concatenate([t_ns[:120], t_ns[140:]])
    p_W, R_WB, _ = motion(t_ns)
    truth = GroundTruth(t_ns, p_W, R_WB)
    wanted = t_ns[[10, 60, 200]] + 2_000_000
    state = truth.states_at(wanted)
    # A difference over 0.1 s smooths away the third derivative times 0.05^2 / 6: 0.011 m/s here.
    assert np.abs(state.v_W - motion(wanted)[2]).max() < 0.015
    assert np.abs(state.p_W - motion(wanted)[0]).max() < 1e-4
    for row in (2, 118, 121, len(t_ns) - 2):
        with pytest.raises(DataError, match="must have a state at each keyframe"):
            truth.states_at(t_ns[[row]])
    with pytest.raises(DataError, match="to derive them"):
        GroundTruth(t_ns[::20], p_W[::20], R_WB[::20]).states_at(t_ns[[20]])


def test_no_state_is_made_up_in_a_hole_or_outside():
    """Catches motion drawn through a second without truth, or carried on past the last sample."""
    t_ns = np.array(IMU_NS[:20] + [IMU_NS[19] + LARGEST_GAP_NS + 1])
    truth = GroundTruth(t_ns, *motion(t_ns))
    assert truth.serves(
        np.array([IMU_NS[0] - 500, IMU_NS[3] + 17, IMU_NS[19] + 2_000, t_ns[-1] + 2_000])
    ).tolist() == [True, True, False, False]
    with pytest.raises(DataError, match="states 55 ms apart around it") as caught:
        truth.states_at(np.array([IMU_NS[0], IMU_NS[19] + 20_000_000]))
    assert (caught.value.row, caught.value.value) == (1, IMU_NS[19] + 20_000_000)
