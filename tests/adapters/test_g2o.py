"""g2o files through the adapter, against residuals differenced as g2o defines them, and against GTSAM."""

from pathlib import Path

import numpy as np
import pytest

import vigauge as vg
from support.foreign_files import Plane, Space, information
from vigauge.adapters import g2o


def differenced(graph: Space | Plane, n: int) -> np.ndarray:
    steps = 1e-4 * np.eye(n)
    f = graph.residuals
    return np.array([(8 * (f(d) - f(-d)) - f(2 * d) + f(-2 * d)) / 12e-4 for d in steps]).T


def test_space_with_points(tmp_path: Path) -> None:
    """Catches a side, a half angle, an offset or an order of rows in the file that differ from g2o's."""
    graph = Space(noise=0.1)
    found = g2o.covariance(graph.write(tmp_path / "graph.g2o"))
    J = differenced(graph, 39)
    expected = np.linalg.pinv(J.T @ J, rcond=1e-9, hermitian=True)
    rows = np.concatenate([found.layout.columns(n) for n in graph.numbers])
    rows = np.concatenate(
        [rows, *(found.layout.points[found.layout.point_place(n)] for n in graph.point_numbers)]
    )
    assert found.open == vg.Euclidean().directions
    assert vg.relative_frobenius(found.entries(rows, rows), expected) < 1e-8


def test_the_plane_with_points(tmp_path: Path) -> None:
    graph = Plane()
    found = g2o.covariance(graph.write(tmp_path / "graph.g2o"))
    J = differenced(graph, 19)
    expected = np.linalg.pinv(J.T @ J, rcond=1e-9, hermitian=True)
    rows = np.concatenate([found.layout.columns(n) for n in [0, 3, 6, 9, 12, 1, 2]])
    assert found.open == ("yaw", "x", "y")
    assert vg.relative_frobenius(found.entries(rows, rows), expected) < 1e-8


@pytest.mark.oracle
@pytest.mark.parametrize("space", [True, False])
def test_poses_are_those_of_marginals(tmp_path: Path, space: bool) -> None:
    """GTSAM reads the same file; catches an order of the information's 21 numbers that only we understand."""
    gtsam = pytest.importorskip("gtsam", reason="needs GTSAM: pip install gtsam")
    path, name = tmp_path / "graph.g2o", "pose3example-grid.txt" if space else "noisyToyGraph.txt"
    given, values = gtsam.readG2o(gtsam.findExampleDataFile(name), space)
    best = gtsam.NonlinearFactorGraph()
    at, between, prior, size = (
        (values.atPose3, gtsam.BetweenFactorPose3, gtsam.PriorFactorPose3, 6)
        if space
        else (values.atPose2, gtsam.BetweenFactorPose2, gtsam.PriorFactorPose2, 3)
    )
    rng = np.random.default_rng(2)
    for k in range(given.size()):  # the residuals' charts agree where residuals are zero
        i, j = given.at(k).keys()
        noise = gtsam.noiseModel.Gaussian.Information(information(rng, size))
        best.add(between(i, j, at(i).between(at(j)), noise))
    gtsam.writeG2o(best, values, str(path))
    whole, values = gtsam.readG2o(str(path), space)
    at = values.atPose3 if space else values.atPose2
    whole.add(prior(0, at(0), gtsam.noiseModel.Isotropic.Sigma(size, 0.01)))
    marginals, found = gtsam.Marginals(whole, values), g2o.covariance(path, rotation="angle")
    for k in (1, 3):
        block = found.block(k, k, vg.KeyframeGauge(0))
        if space:
            row = found.layout.place(k)
            block = vg.as_convention(block, found.R[row], source="g2o", to="gtsam")
        else:
            turn = np.eye(3)
            turn[:2, :2] = at(k).rotation().matrix().T
            block = turn @ block @ turn.T
        carried = at(k).between(at(0)).AdjointMap()
        expected = marginals.marginalCovariance(k) - 0.01**2 * carried @ carried.T
        assert vg.relative_frobenius(block, expected) < 1e-5  # the file has six digits


POSES = "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\n"
EDGE = "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n"
SPACE = "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n"


@pytest.mark.parametrize(
    ("text", "row", "words"),
    [
        ("", None, "must have poses of one kind"),
        (POSES + EDGE + SPACE.replace(" 0", " 9", 1), 4, "must have an edge (found 9)"),
        (POSES + EDGE + "EDGE_SE2 0 1 1 0", 4, "must have 11 columns after its name (found 4)"),
        (POSES + EDGE.replace("1 0 1\n", "1 0 nan\n"), 3, "must be a finite number (found 'nan')"),
        (POSES + EDGE.replace("0 1 0 1\n", "0 1 2 1\n"), 3, "must have no negative eigenvalue"),
        (POSES + EDGE.replace("0 1", "0 5", 1), 3, "must join what the file has as VERTEX_SE2 (found 5)"),
        (POSES + EDGE.replace("0 1", "0 0", 1), 3, "must join two vertices (found 0)"),
        (POSES + EDGE.replace("0 1", "0 -1", 1), 3, "must be the number of a vertex (found '-1')"),
        (POSES + POSES + EDGE, 3, "must have a number of its own (found 0)"),
        (POSES.replace("1 1 0 0", "1 1e90 0 0") + EDGE, 3, "whose products are below"),
        (POSES + EDGE + "EDGE_PRIOR 0 1", 4, "must be one of VERTEX_SE2"),
        (POSES + EDGE + "FIX 0 1", None, "FIX: may hold one pose"),
        (SPACE.replace(" 1\n", " 2\n"), 1, "quaternion qx qy qz qw must have length 1 (found 2.0)"),
        (
            SPACE + "VERTEX_TRACKXYZ 1 1 1 1\nEDGE_SE3_TRACKXYZ 0 1 4 1 1 1 1 0 0 1 0 1",
            3,
            "PARAMS_SE3OFFSET of",
        ),
    ],
)
def test_broken_files_are_refused(tmp_path: Path, text: str, row: int | None, words: str) -> None:
    path = tmp_path / "graph.g2o"
    path.write_text(text)
    with pytest.raises(vg.DataError) as refused:
        g2o.covariance(path)
    assert words in str(refused.value) and (refused.value.file, refused.value.row) == (str(path), row)
