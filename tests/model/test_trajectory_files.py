"""Trajectories on disk: nothing lost that the format can hold, read by evo, and broken files refused."""

from pathlib import Path

import numpy as np
import pytest

import vigauge as vg
from vigauge.geometry import so3

START_NS = 1_403_636_580_838_555_648


@pytest.fixture(scope="module")
def state() -> vg.State:
    """The example's estimate, with a first rotation whose total increment is neither zero nor about z."""
    start = vg.solve(vg.example_problem(), vg.FreeGauge()).state
    return start.retract(np.concatenate([np.zeros(30), [0.3, -0.2, 0.1], np.zeros(start.n_parameters - 33)]))


@pytest.fixture(scope="module")
def blocks(state: vg.State) -> np.ndarray:
    return vg.Covariance.of(vg.example_problem(), state).keyframes(vg.KeyframeGauge(4))


@pytest.fixture
def times(state: vg.State) -> np.ndarray:
    return START_NS + 50_000_001 * np.arange(state.n_keyframes)


def same_poses(a: vg.Trajectory, b: vg.State) -> None:
    assert np.array_equal(a.p_W, b.p_W)
    np.testing.assert_allclose(a.R_WB, b.R_WB, atol=1e-15)


def test_tum_keeps_poses_and_every_nanosecond(tmp_path: Path, state: vg.State, times: np.ndarray) -> None:
    path = tmp_path / "estimate.tum"
    vg.save_trajectory(path, state, times_ns=times)
    loaded = vg.load_trajectory(path)
    same_poses(loaded, state)
    assert np.array_equal(loaded.times_ns, times)
    assert loaded.covariance is None and loaded.v_W is None


@pytest.mark.oracle
def test_evo_reads_tum(tmp_path: Path, state: vg.State, times: np.ndarray) -> None:
    """Catches another order of the quaternion, or its inverse."""
    file_interface = pytest.importorskip("evo.tools.file_interface")
    path = tmp_path / "estimate.txt"
    vg.save_trajectory(path, state, times_ns=times)
    read = file_interface.read_tum_trajectory_file(str(path))
    assert np.array_equal(read.positions_xyz, state.p_W)
    np.testing.assert_allclose([T[:3, :3] for T in read.poses_se3], state.R_WB, atol=1e-14)
    np.testing.assert_allclose(read.timestamps, times * 1e-9, rtol=1e-15)
    written = tmp_path / "by_evo.tum"
    file_interface.write_tum_trajectory_file(str(written), read)
    same_poses(vg.load_trajectory(written), state)


@pytest.mark.parametrize("with_times", [True, False])
def test_csv_keeps_sigmas(
    tmp_path: Path, state: vg.State, blocks: np.ndarray, times: np.ndarray, with_times: bool
) -> None:
    path = tmp_path / "estimate.csv"
    stamps = times if with_times else None
    vg.save_trajectory(path, state, blocks, times_ns=stamps, gauge=vg.KeyframeGauge(4), frame="map")
    loaded = vg.load_trajectory(path)
    same_poses(loaded, state)
    assert np.array_equal(loaded.v_W, state.v_W)
    assert np.array_equal(loaded.times_ns, times) if with_times else loaded.times_ns is None
    sigma = np.sqrt(np.maximum(np.diagonal(blocks, axis1=1, axis2=2), 0.0))
    np.testing.assert_allclose(loaded.sigma[1:], sigma[1:], rtol=1e-14)
    assert (loaded.gauge, loaded.frame, loaded.side) == ("keyframe:4", "map", "left")
    assert "sigma_rx_rad" in path.read_text(encoding="utf-8").splitlines()[0]


def test_npz_keeps_everything(tmp_path: Path, state: vg.State, blocks: np.ndarray, times: np.ndarray) -> None:
    path = tmp_path / "estimate.npz"
    vg.save_trajectory(path, state, blocks, times_ns=times, gauge="keyframe:4")
    loaded = vg.load_trajectory(path)
    assert np.array_equal(loaded.R_WB, state.R_WB)
    np.testing.assert_allclose(loaded.covariance[1:], blocks[1:], atol=1e-15 * blocks.max())
    assert loaded.axes == ["x", "y", "z", "rx", "ry", "rz", "vx", "vy", "vz"]
    with np.load(path) as raw:
        assert raw["units"].tolist() == ["m"] * 3 + ["rad"] * 3 + ["m/s"] * 3
        assert raw["axes"].tolist() == loaded.axes
    again = tmp_path / "again.npz"
    vg.save_trajectory(again, loaded)
    assert again.read_bytes() == path.read_bytes()


def test_first_rotation_is_by_its_left_increment(tmp_path: Path, state: vg.State, blocks: np.ndarray) -> None:
    """Catches a first row in another chart than the others: a State's covariance has dphi_0, Eq. (9)."""
    path = tmp_path / "estimate.npz"
    vg.save_trajectory(path, state, blocks, gauge="keyframe:4")
    small = 1e-6 * np.eye(3)
    turns = so3.log(so3.exp(state.dphi_0 + small) @ so3.exp(state.dphi_0 - small).swapaxes(1, 2))
    J = turns.T / 2e-6
    found = vg.load_trajectory(path).covariance[0]
    expected = J @ blocks[0, 3:6, 3:6] @ J.T
    np.testing.assert_allclose(found[3:6, 3:6], expected, atol=1e-8 * np.abs(expected).max())
    assert np.abs(found[3:6, 3:6] - blocks[0, 3:6, 3:6]).max() > 1e-3 * np.abs(expected).max()


def test_biases_are_no_part_of_a_trajectory(
    tmp_path: Path, state: vg.State, blocks: np.ndarray, times: np.ndarray
) -> None:
    """Catches an estimate with biases that cannot be written as others are, or written as velocities."""
    wide = np.zeros((len(blocks), 15, 15))
    wide[:, :9, :9], wide[:, 9:, 9:] = blocks, np.eye(6)
    biased, path = state.with_biases(np.zeros(3), np.ones(3)), tmp_path / "estimate.npz"
    vg.save_trajectory(path, biased, wide, times_ns=times, gauge="fix")
    loaded = vg.load_trajectory(path)
    vg.save_trajectory(path, state, blocks, times_ns=times, gauge="fix")
    assert np.array_equal(loaded.covariance, vg.load_trajectory(path).covariance)
    assert loaded.kinds == ("position", "rotation", "velocity")


def test_arrays_of_another_estimator(tmp_path: Path, state: vg.State) -> None:
    path, C = tmp_path / "estimate.npz", np.tile(np.diag(np.arange(1.0, 7.0)), (state.n_keyframes, 1, 1))
    vg.save_trajectory(path, (state.R_WB, state.p_W), C, gauge="first", side="right")
    loaded = vg.load_trajectory(path)
    assert loaded.v_W is None and loaded.side == "right"
    assert loaded.kinds == ("position", "rotation")
    velocities = C[:, :3, :3]
    poses = np.tile(np.eye(4), (state.n_keyframes, 1, 1))
    poses[:, :3, 3] = state.p_W
    vg.save_trajectory(path, poses, velocities, gauge="first", kinds=["velocity"])
    assert vg.load_trajectory(path).axes == ["vx", "vy", "vz"]


@pytest.mark.parametrize("ending", ["csv", "npz"])
def test_names_of_keyframes_are_kept(tmp_path: Path, state: vg.State, ending: str) -> None:
    """Catches rows that are counted from 0 beside a gauge that names a keyframe by its key."""
    path, keys = tmp_path / f"poses.{ending}", [2 * k + 1 for k in range(state.n_keyframes)]
    vg.save_trajectory(path, state, keys=keys)
    assert vg.load_trajectory(path).keys == tuple(map(str, keys))
    vg.save_trajectory(path, state)
    assert vg.load_trajectory(path).keys is None
    with pytest.raises(vg.DataError, match="different names"):
        vg.save_trajectory(path, state, keys=keys[1:])


def test_a_covariance_of_the_library_is_asked(tmp_path: Path) -> None:
    """As its state with its blocks; sigma() is what the file has of keyframes after the first."""
    problem = vg.example_problem()
    covariance = vg.Covariance.of(problem, problem.initial)
    vg.save_trajectory(tmp_path / "one.npz", covariance, gauge=vg.CentroidGauge())
    blocks = covariance.keyframes(vg.CentroidGauge())
    vg.save_trajectory(tmp_path / "two.npz", problem.initial, blocks, gauge=vg.CentroidGauge())
    one, two = (vg.load_trajectory(tmp_path / name) for name in ("one.npz", "two.npz"))
    np.testing.assert_array_equal(one.covariance, two.covariance)
    for k, kind in enumerate(one.kinds):
        own = covariance.sigma(kind, vg.CentroidGauge())
        np.testing.assert_allclose(own[1:], one.sigma[1:, 3 * k : 3 * k + 3], rtol=1e-9)
    with pytest.raises(vg.DataError, match="such as vg.CentroidGauge"):
        vg.save_trajectory(tmp_path / "one.npz", covariance, gauge="centroid")
    with pytest.raises(vg.DataError, match="kind: must be one of position, rotation, velocity, points"):
        covariance.sigma("gyro_bias", vg.CentroidGauge())


def test_a_gauge_of_pose_and_scale_has_a_name(tmp_path: Path, state: vg.State, blocks: np.ndarray) -> None:
    """As ``vigauge covariance`` names it."""
    for scale, name in ((vg.Distance(2, 1), "distance:2:1"), (vg.MeanDepth(3), "depth:3")):
        vg.save_trajectory(tmp_path / "poses.npz", state, blocks, gauge=(vg.KeyframeGauge(2), scale))
        assert vg.load_trajectory(tmp_path / "poses.npz").gauge == f"keyframe:2 {name}"


def test_rounding_where_a_gauge_holds_is_no_asymmetry(tmp_path: Path, state: vg.State) -> None:
    C = np.tile(np.eye(6), (state.n_keyframes, 1, 1))
    C[3, :3, :3] = 1e-17 * np.arange(9).reshape(3, 3) - 1e-17
    vg.save_trajectory(tmp_path / "a.npz", (state.R_WB, state.p_W), C, gauge="keyframe:3")
    assert np.array_equal(vg.load_trajectory(tmp_path / "a.npz").sigma[2], np.ones(6))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"path": "a.kitti"}, r"must end in \.tum, \.txt, \.csv, \.npz.*'\.kitti'"),
        ({"path": "a.tum"}, "TUM has no place for a covariance"),
        ({"path": "a.tum", "covariance": None, "gauge": "", "times_ns": None}, "TUM needs times"),
        ({"gauge": ""}, "gauge: must be named with a covariance"),
        ({"gauge": 7}, "must be a gauge or the name of one"),
        ({"covariance": None}, "must come with a covariance"),
        ({"covariance": np.eye(90)}, r"must be \(N, 6, 6\) or \(N, 9, 9\)"),
        ({"covariance": -np.tile(np.eye(6), (10, 1, 1))}, "row 0.*without negative"),
        ({"covariance": np.tile(np.eye(6) + np.eye(6, k=1), (10, 1, 1))}, "row 0: must be symmetric"),
        ({"covariance": np.tile(np.eye(6), (9, 1, 1))}, r"shape \(10, 6, 6\)"),
        ({"kinds": ["position", "bias"]}, "must be different ones of position, rotation, velocity"),
        ({"frame": 3}, "frame: must be a printable name"),
        ({"gauge": "a\nb"}, "gauge: must be a printable name"),
        ({"side": "gtsam"}, "must be left or right"),
        ({"times_ns": np.arange(10.0)}, "must be integers"),
        ({"times_ns": [0, 1, 2, 3, 3, 5, 6, 7, 8, 9]}, r"row 4, times_ns: must increase \(found 3\)"),
        ({"times_ns": [1, 2]}, "times_ns"),
    ],
)
def test_what_cannot_be_written_is_refused(
    tmp_path: Path, state: vg.State, change: dict[str, object], words: str
) -> None:
    arguments: dict[str, object] = {
        "path": "a.csv",
        "covariance": np.tile(np.eye(6), (10, 1, 1)),
        "gauge": "centroid",
        "times_ns": np.arange(10),
    } | change
    path = tmp_path / str(arguments.pop("path"))
    with pytest.raises(vg.DataError, match=words):
        vg.save_trajectory(path, state, **arguments)
    assert not list(tmp_path.iterdir())


GOOD = "1.5 0 0 0 0 0 0 1\n"
HEADER = "keyframe,t_ns,x_m,y_m,z_m,qx,qy,qz,qw,frame,side,gauge\n"
ROW = "0,5,0,0,0,0,0,0,1,W,left,\n"


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.tum", GOOD + "2 0 0 0 0 0 0\n", r"row 2: must have 8 columns.*found 7"),
        ("a.tum", GOOD + "2 0 x 0 0 0 0 1\n", "row 2: must be a finite number.*'x'"),
        ("a.tum", GOOD + "2 0 nan 0 0 0 0 1\n", "row 2: must be a finite number"),
        ("a.tum", GOOD + "2 0 0 0 0 0 0 2\n", "row 2: quaternion.*length 1.*2.0"),
        ("a.tum", GOOD + "2 0 1e200 0 0 0 0 1\n", r"row 2: must be below 1e\+100 in size"),
        ("a.tum", "# t\n" + GOOD + GOOD, "row 3: times must increase"),
        ("a.tum", "1e999999 0 0 0 0 0 0 1\n", "row 1, t: must be a finite number"),
        ("a.tum", "1e10 0 0 0 0 0 0 1\n", "row 1, t: must be a time in seconds"),
        ("a.csv", HEADER + ROW.replace(",5,", ",5.0,"), "row 2, t_ns: must be integer nanoseconds"),
        ("a.csv", HEADER + ROW + ROW, "row 3: times must increase"),
        ("a.csv", HEADER + ROW + ROW.replace(",5,", ",6,").replace("W", "map"), "row 3, frame: must be 'W'"),
        ("a.csv", HEADER.replace("z_m", "z") + ROW, "z_m: column must be present"),
        ("a.csv", HEADER + "0,5\n", "row 2: must have 12 columns"),
        ("a.csv", HEADER, "must have a header and a keyframe"),
        ("a.csv", HEADER + ROW.replace("left", "gtsam"), "must be left or right"),
        ("a.csv", "", "must have a header and a keyframe"),
    ],
)
def test_broken_files_are_refused_with_their_line(tmp_path: Path, name: str, text: str, words: str) -> None:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    with pytest.raises(vg.DataError, match=words) as refused:
        vg.load_trajectory(path)
    assert refused.value.file == str(path)


def test_broken_archives_are_refused(tmp_path: Path, state: vg.State) -> None:
    path = tmp_path / "a.npz"
    vg.save_trajectory(path, state)
    with np.load(path) as raw:
        arrays = dict(raw)
    for change, words in (
        ({"kind": np.array("problems")}, "must hold a trajectory"),
        ({"kinds": np.zeros(2)}, "kinds: must be a list of names"),
        ({"frame": np.zeros(1)}, "frame: must be one text"),
        ({"R_WB": 2.0 * arrays["R_WB"]}, "R_WB.*must be a rotation"),
    ):
        np.savez(path, **arrays | change)
        with pytest.raises(vg.DataError, match=words):
            vg.load_trajectory(path)
    del arrays["p_W"]
    np.savez(path, **arrays)
    with pytest.raises(vg.DataError, match="p_W: array must be present"):
        vg.load_trajectory(path)
    with pytest.raises(vg.DataError, match="file must exist"):
        vg.load_trajectory(tmp_path / "none.tum")
