"""Trajectories in the columns of ROS and OpenVINS: sides, orders, and broken files refused."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import vigauge as vg
from vigauge.files import read_rows
from vigauge.geometry.so3 import hat

TIMES = 1_403_636_580_838_555_648 + 50_000_001 * np.arange(4)


@pytest.fixture
def trajectory() -> vg.Trajectory:
    rng = np.random.default_rng(6)
    A = rng.standard_normal((4, 9, 9))
    return vg.Trajectory(
        rng.uniform(-5.0, 5.0, (4, 3)),
        Rotation.from_rotvec(rng.uniform(-2.0, 2.0, (4, 3))).as_matrix(),
        v_W=rng.standard_normal((4, 3)),
        times_ns=TIMES,
        covariance=A @ A.swapaxes(1, 2),
        kinds=("position", "rotation", "velocity"),
        gauge="first",
        frame="map",
        side="right",
    )


def by_world(trajectory: vg.Trajectory) -> np.ndarray:
    """(N, 6, 6) with turns about the axes of W: Exp(R w) R = R Exp(w)."""
    J = np.tile(np.eye(6), (4, 1, 1))
    J[:, 3:, 3:] = trajectory.R_WB
    return np.asarray(J @ trajectory.covariance[:, :6, :6] @ J.swapaxes(1, 2))


def test_ros_has_turns_about_fixed_axes(tmp_path: Path, trajectory: vg.Trajectory) -> None:
    """Catches increments in the body, or an order of the 36 numbers, that ROS does not have."""
    path = tmp_path / "poses.csv"
    vg.save_trajectory(path, trajectory, format="ros")
    row = read_rows(path)[2]
    assert (row["field.header.stamp"], row["field.header.frame_id"]) == (str(TIMES[2]), "map")
    assert float(row["field.pose.pose.position.y"]) == trajectory.p_W[2, 1]
    written = np.reshape([float(row[f"field.pose.covariance{k}"]) for k in range(36)], (6, 6))
    np.testing.assert_allclose(written, by_world(trajectory)[2], atol=1e-12)
    found = vg.load_trajectory(path, gauge="first")
    np.testing.assert_allclose(found.covariance, by_world(trajectory), atol=1e-12)
    np.testing.assert_allclose(found.R_WB, trajectory.R_WB, atol=1e-12)
    assert (found.frame, found.side, found.times_ns.tolist()) == ("map", "left", TIMES.tolist())


def test_ros_odometry(tmp_path: Path, trajectory: vg.Trajectory) -> None:
    """As `rostopic echo -p` prints nav_msgs/Odometry: columns of a twist and a child frame lie between."""
    path, plain = tmp_path / "odometry.csv", tmp_path / "poses.csv"
    vg.save_trajectory(plain, trajectory, format="ros")
    rows = [line.split(",") for line in plain.read_text().splitlines()]
    extra = [["field.child_frame_id", "field.twist.twist.linear.x"], *[["body", "1.0"]] * 4]
    path.write_text("\n".join(",".join(r[:4] + e + r[4:]) for r, e in zip(rows, extra, strict=True)))
    one, other = (vg.load_trajectory(p, gauge="first") for p in (path, plain))
    assert np.array_equal(one.covariance, other.covariance) and np.array_equal(one.p_W, other.p_W)


def state_file(trajectory: vg.Trajectory, folder: Path) -> tuple[Path, Path]:
    """As ov_msckf writes: time, JPL quaternion of W to B, p, v, bg, ba, and calibration behind."""
    estimate, deviations = folder / "ov_estimate.txt", folder / "ov_estimate_std.txt"
    q = Rotation.from_matrix(trajectory.R_WB).as_quat()
    for x, R in zip(q, trajectory.R_WB, strict=True):  # JPL: C(q) = I - 2 w [q x] + 2 [q x]^2 turns W into B
        C = np.eye(3) - 2.0 * x[3] * hat(x[:3]) + 2.0 * hat(x[:3]) @ hat(x[:3])
        np.testing.assert_allclose(C, R.T, atol=1e-12)
    zeros, more = np.zeros((4, 6)), np.ones((4, 32))
    sigma = trajectory.sigma[:, [3, 4, 5, 0, 1, 2, 6, 7, 8]]
    for path, parts in {
        estimate: (q, trajectory.p_W, trajectory.v_W, zeros, more),
        deviations: (sigma, zeros, more),
    }.items():
        lines = []
        for t, row in zip(TIMES.tolist(), np.concatenate(parts, axis=1).tolist(), strict=True):
            lines.append(f"{t // 10**9}.{t % 10**9:09d} {' '.join(map(repr, row))} ")
        path.write_text("\n".join(lines) + "\n")
    return estimate, deviations


def test_state_file_of_openvins(tmp_path: Path, trajectory: vg.Trajectory) -> None:
    """Catches the inverse rotation, rotations and positions exchanged, a side that is not OpenVINS'."""
    estimate, deviations = state_file(trajectory, tmp_path)
    found = vg.load_trajectory(estimate, gauge="first", deviations=deviations)
    np.testing.assert_allclose(found.R_WB, trajectory.R_WB, atol=1e-12)
    assert np.array_equal(found.p_W, trajectory.p_W) and np.array_equal(found.v_W, trajectory.v_W)
    assert np.array_equal(found.sigma, trajectory.sigma) and found.kinds == trajectory.kinds
    assert found.side == "right" and np.array_equal(found.times_ns, TIMES)
    assert vg.load_trajectory(estimate).sigma is None


def test_rows_of_ov_eval(tmp_path: Path, trajectory: vg.Trajectory) -> None:
    """Rotation first there, and upper triangles; what lies between the two is not in the file."""
    path = tmp_path / "poses.txt"
    vg.save_trajectory(path, trajectory, format="openvins")
    header, *rows = path.read_text().splitlines()
    assert header.startswith("# timestamp(s) tx ty tz qx qy qz qw Pr11 Pr12 Pr13 Pr22 Pr23 Pr33 Pt11")
    C = trajectory.covariance[1]
    expected = [C[3, 3], C[3, 4], C[3, 5], C[4, 4], C[4, 5], C[5, 5], C[0, 0], C[0, 1], C[0, 2], C[1, 1]]
    np.testing.assert_allclose(list(map(float, rows[1].split()))[8:18], expected)
    found = vg.load_trajectory(path, gauge="first")
    np.testing.assert_allclose(found.sigma, trajectory.sigma[:, :6])
    assert found.side == "right" and found.covariance is None


def test_broken_files_are_refused(tmp_path: Path, trajectory: vg.Trajectory) -> None:
    """One sentence with the line; a gauge is never made up."""
    ros, rows, tum = tmp_path / "poses.csv", tmp_path / "poses.txt", tmp_path / "poses.tum"
    vg.save_trajectory(ros, trajectory, format="ros")
    vg.save_trajectory(rows, trajectory, format="openvins")
    vg.save_trajectory(tum, (trajectory.R_WB, trajectory.p_W), times_ns=TIMES)
    estimate, deviations = state_file(trajectory, tmp_path)

    def refused(words: str, path: Path, line: int | None = None, **how: object) -> None:
        with pytest.raises(vg.DataError, match=words) as found:
            vg.load_trajectory(path, **how)
        assert found.value.row == line

    for path in (ros, rows):
        refused("gauge: must be named, as the file has none", path)
        refused("has its covariances itself", path, gauge="first", deviations=deviations)
    refused("gauge: must be named, as the file has none", estimate, deviations=deviations)
    refused("has no covariance: give the file of deviations=", estimate, gauge="first")
    refused("it is for files of ROS and OpenVINS", tum, gauge="first")
    whole = deviations.read_text().splitlines()
    deviations.write_text("\n".join(whole[:2] + whole[3:]))
    refused("must have the times of", estimate, 3, gauge="first", deviations=deviations)
    deviations.write_text("\n".join(whole[:3]))
    refused("must have the times of", estimate, 3, gauge="first", deviations=deviations)
    text = rows.read_text().splitlines()
    rows.write_text("\n".join([*text[:3], text[3] + " 1"]))
    refused("must have 20 columns", rows, 4, gauge="first")
    text = ros.read_text().splitlines()
    for old, new, words in (("map", "odom", "must be 'map'"), (",2,", ",2,x", "must be integer nanoseconds")):
        ros.write_text("\n".join([*text[:3], text[3].replace(old, new, 1), text[4]]))
        refused(words, ros, 4, gauge="first")
    ros.write_text("\n".join(line.replace("covariance7,", "covarianceX,") for line in text))
    refused("field.pose.covariance7: column must be present", ros, gauge="first")


def test_what_a_format_cannot_hold_is_refused(tmp_path: Path, trajectory: vg.Trajectory) -> None:
    poses = trajectory.R_WB, trajectory.p_W
    with pytest.raises(vg.DataError, match="must be one of ros for .csv, openvins for .txt"):
        vg.save_trajectory(tmp_path / "a.csv", trajectory, format="openvins")
    with pytest.raises(vg.DataError, match="must have the covariance of poses"):
        vg.save_trajectory(tmp_path / "a.csv", poses, times_ns=TIMES, format="ros")
    with pytest.raises(vg.DataError, match="times_ns: must have a keyframe at least, and times"):
        vg.save_trajectory(
            tmp_path / "a.csv", poses, trajectory.covariance[:, :6, :6], gauge="first", format="ros"
        )
    assert not list(tmp_path.iterdir())
