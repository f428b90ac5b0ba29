"""`vigauge covariance` and `vigauge diagnose`: what they write and say, and their exit status."""

import argparse
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse

import vigauge as vg
from support.foreign import Estimate, retracted
from support.foreign import problem as foreign_problem
from support.foreign_files import Adjustment, Plane, Space
from vigauge.adapters import bal, g2o
from vigauge.adapters.information import Information
from vigauge.cli import estimate_file

GAUGES = {
    "first": vg.FixedGauge(),
    "centroid": vg.CentroidGauge(),
    "free": vg.FreeGauge(),
    "keyframe:3": vg.KeyframeGauge(3),
}


def command(*arguments: object) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-m", "vigauge.cli", *map(str, arguments)]
    return subprocess.run(words, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("example") / "problem.npz"
    vg.save_problems(path, [vg.example_problem()])
    return path


def information(side: str = "gtsam", *, csr: bool = False) -> dict[str, object]:
    """H.npz of a random graph with rotations first, velocities and biases."""
    layout = vg.Layout.by_keyframe(5, ["rotation", "position", "velocity", "bias:6"], points=4, side=side)
    at, _, J = foreign_problem(layout, vg.YawTranslation(), np.random.default_rng(5))
    H = (J.T @ J).toarray()
    H = 0.5 * (H + H.T)
    arrays: dict[str, object] = {"H": H, "points": layout.points, "side": side}
    if csr:
        S = scipy.sparse.csr_array(arrays.pop("H"))
        arrays |= {"H_data": S.data, "H_indices": S.indices, "H_indptr": S.indptr}
    arrays |= {kind: layout.blocks[kind] for kind in ("position", "rotation", "velocity")}
    arrays |= {"other.bias": layout.blocks["bias"], "R_WB": at.R, "p_W": at.p, "v_W": at.v, "X_W": at.X}
    return arrays


@pytest.mark.parametrize("gauge", GAUGES)
def test_covariance_of_a_problem(tmp_path: Path, example: Path, gauge: str) -> None:
    out = tmp_path / "all.npz"
    done = command("covariance", example, "--gauge", gauge, "--of", "all", "--out", out)
    assert done.returncode == 0, done.stderr
    problem = vg.example_problem()
    state = vg.solve(problem, vg.FreeGauge()).state
    blocks = vg.Covariance.of(problem, state).keyframes(GAUGES[gauge])
    found = vg.load_trajectory(out)
    # The command runs BLAS on one thread, so last digits may differ.
    np.testing.assert_allclose(found.p_W, state.p_W, atol=1e-9)
    np.testing.assert_allclose(found.covariance[1:], blocks[1:], atol=1e-7 * blocks.max())
    assert found.gauge == gauge


def test_sigmas_of_velocities_at_the_start(tmp_path: Path, example: Path) -> None:
    """Catches a flag that is not heard: the start is not the estimate, and velocities are not poses."""
    out = tmp_path / "v.csv"
    flags = ("--gauge", "centroid", "--of", "velocities", "--at-start", "--out", out)
    assert command("covariance", example, *flags).returncode == 0
    problem = vg.example_problem()
    found = vg.load_trajectory(out)
    assert np.array_equal(found.p_W, problem.initial.p_W)
    blocks = vg.Covariance.of(problem, problem.initial).keyframes(vg.CentroidGauge())
    expected = np.sqrt(np.diagonal(blocks, axis1=1, axis2=2)[:, 6:])
    np.testing.assert_allclose(found.sigma, expected, rtol=1e-6)


@pytest.mark.parametrize(("side", "csr"), [("gtsam", False), ("colmap", True)])
def test_covariance_of_an_information_matrix(tmp_path: Path, side: str, csr: bool) -> None:
    """Rotations of any side come out as left increments, checked by differences of the retraction."""
    arrays = information(side, csr=csr)
    path, out = tmp_path / "H.npz", tmp_path / "poses.npz"
    np.savez(path, **arrays, times_ns=np.arange(5) * 10)
    done = command("covariance", path, "--gauge", "keyframe:2", "--out", out)
    assert done.returncode == 0, done.stderr
    found = vg.load_trajectory(out)
    assert found.times_ns.tolist() == [0, 10, 20, 30, 40]
    given = estimate_file.read(path, 0)
    assert isinstance(given, Information)
    whole = vg.Covariance.from_hessian(given.H, **given.estimate).matrix(vg.KeyframeGauge(2))
    at, n, step = foreign_estimate(given), given.layout.n, 1e-6
    for k in range(5):
        columns = given.layout.columns(k)[:6]
        J = np.empty((6, 6))
        for row, column in enumerate(columns):
            plus, minus = (retracted(given.layout, at, s * step * np.eye(n)[column]) for s in (1, -1))
            turn = plus.R[k] @ minus.R[k].T
            J[:3, row] = (plus.p[k] - minus.p[k]) / (2 * step)
            J[3:, row] = np.array([turn[2, 1], turn[0, 2], turn[1, 0]]) / (2 * step)
        expected = J @ whole[np.ix_(columns, columns)] @ J.T
        np.testing.assert_allclose(found.covariance[k], expected, atol=1e-6 * np.abs(whole).max())


def test_what_is_absolute_in_a_matrix_is_said(tmp_path: Path) -> None:
    """Catches a prior left in H, for which no gauge changes the sigmas, in a file that says it is in one."""
    arrays = information("right", csr=False)
    at = np.concatenate([arrays["position"][1], arrays["rotation"][1]])
    arrays["H"][at, at] += 1e4
    np.savez(tmp_path / "H.npz", **arrays)
    done = command("covariance", tmp_path / "H.npz", "--gauge", "centroid", "--out", tmp_path / "poses.csv")
    assert done.returncode == 0
    assert "H has information along yaw, x, y, z, which no gauge takes out" in done.stderr
    assert "a prior on keyframe 1" in done.stderr
    assert vg.load_trajectory(tmp_path / "poses.csv").gauge == "centroid (measured: yaw x y z)"


def foreign_estimate(given: Information) -> Estimate:
    return Estimate(given.R, given.p, given.velocities, given.points)


def test_diagnose_says_what_is_observable(tmp_path: Path, example: Path) -> None:
    done = command("diagnose", example)
    assert (done.returncode, done.stdout[:8]) == (0, "regular:"), done
    path = tmp_path / "H.npz"
    np.savez(path, **information())
    done = command("diagnose", path)
    assert done.returncode == 0
    assert "regular" in done.stdout and "expected directions" not in done.stdout
    arrays = information()
    np.savez(path, **(arrays | {"H": arrays["H"] + 1e-4 * np.eye(len(arrays["H"]))}))
    done = command("diagnose", path)
    assert done.returncode == 0 and "a damping of 1.0e-04 on the diagonal is left in H" in done.stdout, done


def test_what_is_degenerate_is_withheld(tmp_path: Path) -> None:
    """Status 1, a sentence that names what is open, and no file."""
    problem = vg.example_problem()
    blind = replace(problem, inertial=problem.inertial.only(problem.inertial.second < 7))
    path, out = tmp_path / "problem.npz", tmp_path / "poses.csv"
    vg.save_problems(path, [problem, blind])
    done = command("diagnose", path, "--problem", 1, "--at-start")
    assert done.returncode == 1 and "velocity" in done.stdout, done
    done = command("covariance", path, "--problem", 1, "--at-start", "--gauge", "first", "--out", out)
    assert done.returncode == 1 and "velocity" in done.stderr, done
    assert not out.exists()
    arrays = information()
    bias = arrays["other.bias"][3]
    arrays["H"][bias] = arrays["H"][:, bias] = 0.0
    np.savez(path, **arrays)
    done = command("diagnose", path)
    assert done.returncode == 1 and "6 more than the gauge unobservable: bias" in done.stdout, done


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (("--gauge", "second"), "--gauge: must be first, centroid, free or keyframe:K (found 'second')"),
        (("--gauge", "keyframe:99"), "keyframe 99 is not among 0..9"),
        (("--gauge", "free", "--problem", "1"), "--problem: has 1 problems, from 0 (found 1)"),
        (("--gauge", "free", "--out", "poses.tum"), "--out: must end in .csv or .npz"),
    ],
)
def test_wrong_flags_are_bad_input(tmp_path: Path, example: Path, flags: tuple[str, ...], words: str) -> None:
    done = command("covariance", example, "--at-start", "--out", tmp_path / "poses.csv", *flags)
    assert done.returncode == 2 and words in done.stderr, done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"H": np.zeros((3, 4))}, "H: must have shape"),
        ({"times_ns": np.arange(4)}, r"times_ns: must have shape \(5,\)"),
        ({"v_W": np.zeros((4, 3))}, r"v_W: must have shape \(5, 3\)"),
        ({"H_data": np.zeros(1)}, "is none that --help lists"),
        ({"group": "rigid"}, "group: must be one of yaw-translation, euclidean, similarity"),
        ({"side": np.zeros(2)}, "side: must be one text"),
        ({"side": "up"}, "side: must be one of left"),
        ({"position": np.zeros((5, 3))}, "position: .*must be integers"),
    ],
)
def test_broken_archives_are_refused(tmp_path: Path, changes: dict[str, object], words: str) -> None:
    path = tmp_path / "H.npz"
    np.savez(path, **(information() | changes))
    with pytest.raises(vg.DataError, match=words) as refused:
        estimate_file.read(path, 0)
    assert refused.value.file == str(path)


def test_missing_parts_are_named(tmp_path: Path) -> None:
    path = tmp_path / "H.npz"
    for gone in ("H", "R_WB", "p_W"):
        arrays = information()
        del arrays[gone]
        np.savez(path, **arrays)
        with pytest.raises(vg.DataError, match=f"{gone}: .*must be present"):
            estimate_file.read(path, 0)
    arrays = information(csr=True)
    arrays["H_indices"] = arrays["H_indices"] + 1000
    np.savez(path, **arrays)
    with pytest.raises(vg.DataError, match="must be the CSR form of a square matrix"):
        estimate_file.read(path, 0)


def test_covariance_of_a_pose_graph(tmp_path: Path) -> None:
    """Catches rows out of the order of numbers, and half angles in the body that come out as they are."""
    path, out = Space(noise=0.1).write(tmp_path / "graph.g2o"), tmp_path / "poses.npz"
    done = command("covariance", path, "--gauge", "keyframe:7", "--out", out)
    assert done.returncode == 0, done.stderr
    found, given = vg.load_trajectory(out), g2o.covariance(path)
    blocks = given.keyframes(vg.KeyframeGauge(7))
    expected = vg.as_convention(blocks, given.R, source="g2o", to="left")
    np.testing.assert_allclose(found.covariance, expected, atol=1e-9 * expected.max())
    assert np.abs(found.covariance[2]).max() < 1e-12 * expected.max()
    done = command("diagnose", path)
    assert done.returncode == 0 and done.stdout.startswith("regular:"), done


def test_covariance_of_a_pose_graph_in_the_plane(tmp_path: Path) -> None:
    """Height, roll and pitch are known there; landmarks are no rows of a trajectory."""
    path, out = Plane().write(tmp_path / "graph.g2o"), tmp_path / "poses.npz"
    done = command("covariance", path, "--gauge", "first", "--out", out)
    assert done.returncode == 0, done.stderr
    found, given = vg.load_trajectory(out), g2o.covariance(path)
    assert found.covariance.shape == (5, 6, 6) and not found.covariance[:, 2:5].any()
    expected = given.block(9, 9, vg.FixedGauge())
    np.testing.assert_allclose(found.covariance[3][np.ix_([0, 1, 5], [0, 1, 5])], expected, atol=1e-12)
    done = command("diagnose", path)
    assert done.returncode == 0 and done.stdout.startswith("regular:"), done


def test_covariance_of_a_bundle_adjustment(tmp_path: Path) -> None:
    """Catches a flag that is not heard, and a scale that cannot be given."""
    path, out = Adjustment().write(tmp_path / "bal.txt"), tmp_path / "poses.npz"
    flags = ("--gauge", "keyframe:1", "--known-intrinsics", "--out", out)
    done = command("covariance", path, *flags)
    assert done.returncode == 2 and "must constrain the 7 open directions" in done.stderr, done
    for scale, gauge in {"distance:1:3": vg.Distance(1, 3), "depth:1": vg.MeanDepth(1)}.items():
        done = command("covariance", path, *flags, "--scale", scale)
        assert done.returncode == 0, done.stderr
        found = vg.load_trajectory(out)
        given = bal.covariance(path, intrinsics=False).keyframes((vg.KeyframeGauge(1), gauge))
        np.testing.assert_allclose(found.covariance, given, atol=1e-9 * given.max())
        assert found.gauge == f"keyframe:1 {scale}"
    done = command("covariance", path, *flags, "--scale", "distance:1")
    assert done.returncode == 2 and "--scale: must be distance:I:J or depth:K" in done.stderr


def asked(*arguments: object) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    estimate_file.add_arguments(parser)
    return parser.parse_args(list(map(str, arguments)))


def test_flags_say_what_functions_do(tmp_path: Path) -> None:
    """Catches a flag that is heard by another file, twice, or not at all."""
    bundle, graph = Adjustment().write(tmp_path / "bal.txt"), Space(noise=0.1).write(tmp_path / "graph.g2o")
    for flags, expected in {
        (bundle, "--sigma", 0.5): bal.information(bundle, sigma=0.5),
        (bundle, "--known-intrinsics"): bal.information(bundle, intrinsics=False),
        (bundle,): bal.information(bundle),
        (graph, "--rotation", "angle"): g2o.information(graph, rotation="angle"),
        (graph,): g2o.information(graph),
    }.items():
        found = estimate_file.read_named(asked(*flags))
        assert isinstance(found, Information) and found.H.shape == expected.H.shape
        assert abs(found.H - expected.H).max() == 0.0
    for flags, words in {
        (graph, "--sigma", 0.5): r"--sigma: is about .txt files",
        (graph, "--known-intrinsics"): r"--known-intrinsics: is about .txt files",
        (bundle, "--rotation", "angle"): r"--rotation: is about .g2o files",
        (bundle, "--sigma", 0.0): r"sigma: must be positive",
    }.items():
        with pytest.raises(vg.DataError, match=words):
            estimate_file.read_named(asked(*flags))
    out = tmp_path / "poses.npz"
    done = command("covariance", graph, "--rotation", "angle", "--gauge", "first", "--out", out)
    given = g2o.covariance(graph, rotation="angle")
    blocks = vg.as_convention(given.keyframes(vg.FixedGauge()), given.R, source="g2o", to="left")
    np.testing.assert_allclose(vg.load_trajectory(out).covariance, blocks, atol=1e-9 * blocks.max())
    done = command("diagnose", bundle, "--rotation", "angle")
    assert done.returncode == 2 and "--rotation: is about .g2o files" in done.stderr, done
