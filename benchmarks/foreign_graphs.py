"""Graphs of GTSAM: a chain of any length, what others published in its wheel, and a simulated flight."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gtsam
import numpy as np
from gtsam.symbol_shorthand import K, L, X
from scipy.spatial.transform import Rotation

import vigauge as vg
from vigauge.adapters import bal, g2o
from vigauge.adapters.gtsam import covariance as from_graph
from vigauge.covariance.projection import along_orbit
from vigauge.geometry.so3 import Array

from .foreign_problems import pose_graph
from .foreign_rows import REPEATS, Sizes, least, row, runs_of
from .long_double import inverse_of_triangle
from .peer_gtsam import first_pose_factor, graph_of, values_with_biases
from .results import Row

_PEER = "GTSAM Marginals"
_NOTE = "vigauge.adapters.gtsam, translation of the graph included; compared in the gauge of the peer's prior"
_NO_LOOP = "they differ: without a loop H has a condition of 1e10, and both keep 7 digits of a long double's"
_SIGMA = 1e-3
_SPHERE = "sphere2500.txt"
_CHAIN = "cityTrees_reduced_1k.g2o"
# Degrees of freedom of a pose, and how many poses.
_PUBLIC = {
    "w100_30.g2o": (3, 30),
    "w100.graph": (3, 100),
    _CHAIN: (3, 1000),
    "pose3example-grid.txt": (6, 27),
    _SPHERE: (6, 2500),
}


def graph_row(sizes: Sizes) -> Row:
    """A chain of poses in GTSAM, from its own graph to all blocks."""
    return _pose_row(f"pose graph, n = {6 * sizes.poses}", *pose_graph(sizes.poses), REPEATS)


def public_rows(sizes: Sizes) -> list[Row]:
    """Agreement on published graphs of up to ``sizes.public`` poses, linearised as they are in the file."""
    rows = []
    for name, (size, count) in _PUBLIC.items():
        if count <= sizes.public:
            graph, values = _published(name, size)
            repeats = 1 if count > 1000 else REPEATS
            rows.append(_pose_row(f"{name}, n = {size * count}", graph, values, repeats))
            if name == _CHAIN:
                rows[-1]["note"] = f"{rows[-1]['note']}; {_NO_LOOP}"
                rows.append(_compounded_row(f"{name}, n = {size * count}", graph, values))
    return [*rows, _g2o_row("pose3example-grid.txt"), _flight_row(), _bundle_row("Balbianello.out")]


def _published(name: str, size: int) -> tuple[Any, Any]:
    path = gtsam.findExampleDataFile(name)
    if name != _SPHERE:
        graph, values = gtsam.load3D(path) if size == 6 else gtsam.load2D(path)
        return graph, values
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()  # a file without poses: odometry gives them
    values.insert(0, gtsam.Pose3())
    for factor in gtsam.parse3DFactors(path):
        graph.add(factor)
        i, j = factor.keys()
        if j == i + 1:
            values.insert(j, values.atPose3(i).compose(factor.measured()))
    return graph, values


def _pose_row(case: str, graph: Any, values: Any, repeats: int) -> Row:
    keys = sorted(values.keys())
    return _row(case, graph, values, keys, [_prior(values, keys[0])], repeats)


def _prior(values: Any, key: int) -> Any:
    """On a pose in the plane or in space."""
    try:
        at = values.atPose3(key)
    except RuntimeError:  # the only way to learn a type
        noise = gtsam.noiseModel.Isotropic.Sigma(3, _SIGMA)
        return gtsam.PriorFactorPose2(key, values.atPose2(key), noise)
    return gtsam.PriorFactorPose3(key, at, gtsam.noiseModel.Isotropic.Sigma(6, _SIGMA))


def _row(
    case: str, graph: Any, values: Any, keys: list[int], priors: list[Any], repeats: int = REPEATS
) -> Row:
    """All blocks of poses by the adapter, against Marginals of the graph with priors that close the gauge."""
    theirs, peer_s = least(_marginals(graph, values, keys, priors), repeats)
    kinds = ["rotation", "position"] if theirs.shape[1] == 6 else None

    ours, ours_s = least(lambda: _asked(from_graph(graph, values), vg.CentroidGauge(), keys, kinds))
    layout, V = ours.layout, np.zeros((ours.layout.n, ours.U.shape[1]))
    start = 0
    for linear in (prior.linearize(values) for prior in priors):
        (A, _), of = linear.jacobian(), linear.keys()
        V[np.concatenate([layout.columns(key) for key in of]), start : start + len(A)] = A.T
        start += len(A)
    share = along_orbit(ours.U, V)[[layout.columns(key) for key in keys]]
    theirs = theirs - share @ share.swapaxes(1, 2)
    what = f"all {theirs.shape[1]} x {theirs.shape[1]} blocks, centroid gauge"
    mine = ours.keyframes(V, keys, kinds), ours_s
    return row(case, what, mine, _PEER, (theirs, peer_s), _NOTE, runs_of(repeats, "Marginals"))


def _marginals(graph: Any, values: Any, keys: list[int], priors: list[Any]) -> Callable[[], Array]:
    closed = gtsam.NonlinearFactorGraph(graph)
    for prior in priors:
        closed.add(prior)

    def ask() -> Array:
        found = gtsam.Marginals(closed, values)
        return np.array([found.marginalCovariance(key) for key in keys])

    return ask


def _compounded_row(case: str, graph: Any, values: Any) -> Row:
    """A chain: the covariance of each pose from that of the one before, with 18 digits."""

    def compounded() -> Array:
        out = [np.zeros((3, 3), np.longdouble)]
        for k in range(graph.size()):
            A, _ = graph.at(k).linearize(values).jacobian()
            inverse = inverse_of_triangle(A[:, 3:].astype(np.longdouble))
            F = inverse @ A[:, :3]
            out.append(F @ out[-1] @ F.T + inverse @ inverse.T)
        return np.array(out, float)

    mine = least(lambda: from_graph(graph, values).keyframes(vg.FixedGauge()))
    return row(
        case,
        "all 3 x 3 blocks, first pose held",
        mine,
        "compounding, long double",
        least(compounded),
        _NO_LOOP,
    )


def _flight_row() -> Row:
    """The library's own example, with GTSAM's ImuFactor: four directions."""
    problem = vg.example_problem()
    state = vg.solve(problem, vg.FreeGauge()).state
    prior = first_pose_factor(problem.initial, gtsam.noiseModel.Isotropic.Sigma(4, _SIGMA))
    keys = [X(k) for k in range(state.n_keyframes)]
    graph = graph_of(problem, None)
    return _row("simulated flight, 4 directions", graph, values_with_biases(problem, state), keys, [prior])


def _g2o_row(name: str) -> Row:
    """The same file, read and linearised by each."""
    path = gtsam.findExampleDataFile(name)
    graph, values = gtsam.load3D(path)
    first, *keys = sorted(values.keys())
    prior = _prior(values, first)
    theirs, peer_s = least(_marginals(graph, values, keys, [prior]))
    ours, ours_s = least(
        lambda: g2o.covariance(path, rotation="angle").keyframes(vg.KeyframeGauge(first), keys)
    )
    R = np.array([values.atPose3(key).rotation().matrix() for key in keys])
    carried = np.array([values.atPose3(key).between(values.atPose3(first)).AdjointMap() for key in keys])
    theirs = theirs - _SIGMA**2 * carried @ carried.swapaxes(1, 2)
    ours = vg.as_convention(ours, R, source="g2o", to="gtsam")
    note = (
        "vigauge.adapters.g2o; they differ: GTSAM's residual is a logarithm, g2o's a quaternion's vector part"
    )
    return row(name, "all 6 x 6 blocks, first pose held", (ours, ours_s), _PEER, (theirs, peer_s), note)


def _bundle_row(name: str) -> Row:
    """Snavely's Bundler: cameras with f, k1, k2 and points, which GTSAM and we read on our own."""
    path = gtsam.findExampleDataFile(name)
    data = gtsam.SfmData.FromBundlerFile(path)
    graph, values, pixel = gtsam.NonlinearFactorGraph(), gtsam.Values(), gtsam.noiseModel.Unit.Create(2)
    cameras = [data.camera(k) for k in range(data.numberCameras())]
    for k, camera in enumerate(cameras):
        values.insert(X(k), camera.pose())
        values.insert(K(k), camera.calibration())
    for j, track in enumerate(data.track(j) for j in range(data.numberTracks())):
        values.insert(L(j), track.point3())
        for k, uv in (track.measurement(m) for m in range(track.numberMeasurements())):
            graph.add(gtsam.GeneralSFMFactor2Cal3Bundler(uv, pixel, X(k), L(j), K(k)))
    apart = float(np.linalg.norm(cameras[1].pose().translation() - cameras[0].pose().translation()))
    noise = [gtsam.noiseModel.Isotropic.Sigma(size, _SIGMA) for size in (6, 1)]
    priors: list[Any] = [gtsam.PriorFactorPose3(X(0), cameras[0].pose(), noise[0])]
    priors.append(gtsam.RangeFactorPose3(X(0), X(1), apart, noise[1]))
    theirs, peer_s = least(_marginals(graph, values, [X(k) for k in range(len(cameras))], priors))
    gauge, kinds = (vg.FixedGauge(), vg.Distance(0, 1)), ["position", "rotation"]
    with TemporaryDirectory() as folder:
        copy = Path(folder) / "bal.txt"
        copy.write_text(_as_bal(Path(path)), encoding="utf-8")
        found, ours_s = least(lambda: _asked(bal.covariance(copy), gauge, None, kinds))
    V = vg.gauge_normal(found.layout, (found.R, found.p), gauge, group=vg.Similarity())
    share = _SIGMA * along_orbit(found.U, V)[[found.layout.columns(k)[:6] for k in range(len(cameras))]]
    R = np.array([camera.pose().rotation().matrix() for camera in cameras])
    ours = vg.as_convention(found.keyframes(gauge, None, kinds), R, to="gtsam")
    theirs = theirs - vg.as_convention(share @ share.swapaxes(1, 2), R, to="gtsam")
    note = "vigauge.adapters.bal; the share of the peer's prior on a pose and a distance is taken off"
    what = "all 6 x 6 blocks, first pose and a distance held"
    return row(
        f"{name}, 7 directions, n = {found.layout.n}", what, (ours, ours_s), _PEER, (theirs, peer_s), note
    )


def _asked(
    found: vg.EstimateCovariance, gauge: Any, keys: list[int] | None, kinds: list[str] | None
) -> vg.EstimateCovariance:
    """The covariance, after all blocks were asked for."""
    found.in_gauge(gauge).keyframes(None, keys, kinds)
    return found


def _as_bal(path: Path) -> str:
    """Bundler's file as BAL has it: the same cameras, rotations as vectors."""
    numbers = iter(path.read_text(encoding="utf-8").partition("\n")[2].split())

    def take(count: int) -> list[float]:
        return [float(next(numbers)) for _ in range(count)]

    cameras, points = map(int, take(2))
    sights, tail, places = [], [], []
    for _ in range(cameras):
        own, R, t = take(3), np.reshape(take(9), (3, 3)), take(3)
        tail += [*Rotation.from_matrix(R).as_rotvec().tolist(), *t, *own]
    for j in range(points):
        places += take(6)[:3]
        for camera, _, x, y in (take(4) for _ in range(int(next(numbers)))):
            sights.append(f"{camera:.0f} {j} {x!r} {y!r}")
    lines = [f"{cameras} {points} {len(sights)}", *sights, *map(repr, [*tail, *places])]
    return "\n".join(lines) + "\n"
