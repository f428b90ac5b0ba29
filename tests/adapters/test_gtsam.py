"""Graphs of GTSAM's own factors through the adapter, against Marginals and the dense pseudo-inverse."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vigauge as vg

gtsam = pytest.importorskip("gtsam", reason="needs GTSAM: pip install gtsam")
from gtsam.symbol_shorthand import B, L, V, X  # noqa: E402

from vigauge.adapters.gtsam import covariance, information  # noqa: E402

pytestmark = pytest.mark.oracle


def optimised(graph: Any, values: Any, priors: list[Any]) -> tuple[Any, Any]:
    """The best estimate of a graph with priors, and its Marginals."""
    whole = gtsam.NonlinearFactorGraph(graph)
    for prior in priors:
        whole.add(prior)
    best = gtsam.LevenbergMarquardtOptimizer(whole, values).optimize()
    return best, gtsam.Marginals(whole, best)


def dense(graph: Any, values: Any) -> tuple[np.ndarray, dict[int, slice]]:
    """Pseudo-inverse of GTSAM's own dense Hessian, by eigenvalues, and the columns of each key."""
    ordering = gtsam.Ordering()
    at, start = {}, 0
    for key in sorted(graph.keyVector()):
        ordering.push_back(key)
        width = 3 if chr(gtsam.symbolChr(key)) in "vl" else 6
        at[key], start = slice(start, start + width), start + width
    H, _ = graph.linearize(values).hessian(ordering)
    return np.linalg.pinv(H, rcond=1e-14, hermitian=True), at


def pose_graph() -> tuple[Any, Any]:
    """Stations of a helix with odometry and two loops, as in GTSAM's Pose3SLAMExample."""
    rng, sigmas = np.random.default_rng(1), np.array([0.01, 0.02, 0.03, 0.1, 0.05, 0.2])
    noise = gtsam.noiseModel.Diagonal.Sigmas(sigmas)
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    poses = [gtsam.Pose3.Expmap(np.array([0.1 * k, 0.2, 0.5 * k, k, 5 * np.sin(k), 2])) for k in range(9)]
    for i, j in [*((k, k + 1) for k in range(8)), (0, 5), (2, 8)]:
        error = gtsam.Pose3.Expmap(sigmas * rng.standard_normal(6))
        graph.add(gtsam.BetweenFactorPose3(X(i), X(j), poses[i].between(poses[j]).compose(error), noise))
    for k, pose in enumerate(poses):
        values.insert(X(k), pose)
    return graph, values


def test_poses_are_those_of_marginals() -> None:
    """Catches a side, order or sign that nobody else has: the prior's own share is taken off."""
    graph, values = pose_graph()
    prior = gtsam.PriorFactorPose3(X(0), values.atPose3(X(0)), gtsam.noiseModel.Isotropic.Sigma(6, 0.01))
    best, marginals = optimised(graph, values, [prior])
    found = covariance(graph, best)
    assert found.open == vg.Euclidean().directions
    for k in range(1, 9):
        carried = best.atPose3(X(k)).between(best.atPose3(X(0))).AdjointMap()
        expected = marginals.marginalCovariance(X(k)) - 0.01**2 * carried @ carried.T
        assert vg.relative_frobenius(found.block(X(k), X(k), vg.FixedGauge()), expected) < 1e-8


@pytest.mark.parametrize("name", ["pose3example.txt", "pose3example-grid.txt", "noisyToyGraph.txt"])
def test_graphs_that_ship_with_gtsam(name: str) -> None:
    """Catches what only our own graphs have: keys from 0, loops, noise without correlation."""
    graph, values = gtsam.readG2o(gtsam.findExampleDataFile(name), "pose3" in name)
    first, *others = sorted(graph.keyVector())
    at, kind, size = (
        (values.atPose3, gtsam.PriorFactorPose3, 6)
        if "pose3" in name
        else (values.atPose2, gtsam.PriorFactorPose2, 3)
    )
    found = covariance(graph, values)
    assert len(found.open) == size and not found.measured
    graph.add(kind(first, at(first), gtsam.noiseModel.Isotropic.Sigma(size, 0.01)))
    marginals = gtsam.Marginals(graph, values)
    for key in others:
        carried = at(key).between(at(first)).AdjointMap()
        expected = marginals.marginalCovariance(key) - 0.01**2 * carried @ carried.T
        assert vg.relative_frobenius(found.block(key, key, vg.KeyframeGauge(first)), expected) < 1e-8


def test_robust_weights_and_a_marginalised_factor_count() -> None:
    """Catches rows without the weights of their loss, and factors that have a Hessian and no rows."""
    graph, values = pose_graph()
    loss = gtsam.noiseModel.mEstimator.Huber.Create(0.5)
    noise = gtsam.noiseModel.Robust.Create(loss, gtsam.noiseModel.Isotropic.Sigma(6, 0.01))
    graph.add(gtsam.BetweenFactorPose3(X(1), X(7), gtsam.Pose3(), noise))
    linear = gtsam.NonlinearFactorGraph(graph).linearize(values)
    graph.add(gtsam.LinearContainerFactor(gtsam.HessianFactor(linear.at(3)), values))
    graph.add(gtsam.PriorFactorPose3(X(0), values.atPose3(X(0)), gtsam.noiseModel.Isotropic.Sigma(6, 0.1)))
    expected = gtsam.Marginals(graph, values).marginalCovariance(X(7))
    assert vg.relative_frobenius(covariance(graph, values).block(X(7), X(7)), expected) < 1e-8
    without = pose_graph()[0]
    without.add(gtsam.PriorFactorPose3(X(0), values.atPose3(X(0)), gtsam.noiseModel.Isotropic.Sigma(6, 0.1)))
    other = gtsam.Marginals(without, values).marginalCovariance(X(7))
    assert vg.relative_frobenius(other, expected) > 1e-2


def test_a_prior_in_the_graph_is_a_measurement() -> None:
    graph, values = pose_graph()
    graph.add(gtsam.PriorFactorPose3(X(0), values.atPose3(X(0)), gtsam.noiseModel.Isotropic.Sigma(6, 0.01)))
    found = covariance(graph, values)
    assert not found.open and set(found.measured) == set(vg.Euclidean().directions)
    expected = gtsam.Marginals(graph, values).marginalCovariance(X(5))
    assert vg.relative_frobenius(found.block(X(5), X(5)), expected) < 1e-8


def test_the_plane() -> None:
    """GTSAM's Pose2SLAMExample: a square with a loop."""
    noise = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.2, 0.2, 0.1]))
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    steps = [(1, 2, 0), (2, 3, np.pi / 2), (3, 4, np.pi / 2), (4, 5, np.pi / 2), (5, 2, np.pi / 2)]
    for i, j, turn in steps:
        graph.add(gtsam.BetweenFactorPose2(i, j, gtsam.Pose2(2, 0, turn), noise))
    starts = [(0.5, 0, 0.2), (2.3, 0.1, -0.2), (4.1, 0.1, 1.57), (4, 2, 3.14), (2.1, 2.1, -1.57)]
    for key, start in enumerate(starts, 1):
        values.insert(key, gtsam.Pose2(*start))
    prior = gtsam.PriorFactorPose2(1, gtsam.Pose2(0, 0, 0), gtsam.noiseModel.Isotropic.Sigma(3, 0.1))
    best, marginals = optimised(graph, values, [prior])
    found = covariance(graph, best)
    assert found.open == ("yaw", "x", "y")
    for key in range(2, 6):
        carried = best.atPose2(key).between(best.atPose2(1)).AdjointMap()
        expected = marginals.marginalCovariance(key) - 0.1**2 * carried @ carried.T
        assert vg.relative_frobenius(found.block(key, key, vg.KeyframeGauge(1)), expected) < 1e-8


def inertial_graph(tilt: gtsam.Rot3) -> tuple[Any, Any]:
    """CombinedImuFactors along GTSAM's accelerating, turning body, and stereo-like points seen from it."""
    gravity = tilt.rotate(np.array([0.0, 0.0, -9.81]))
    params = gtsam.PreintegrationCombinedParams(gravity)
    params.setAccelerometerCovariance(1e-4 * np.eye(3))
    params.setGyroscopeCovariance(1e-6 * np.eye(3))
    params.setIntegrationCovariance(1e-8 * np.eye(3))
    params.setBiasAccCovariance(1e-6 * np.eye(3))
    params.setBiasOmegaCovariance(1e-8 * np.eye(3))
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    bias = gtsam.imuBias.ConstantBias(np.array([0.02, -0.01, 0.03]), np.array([0.001, 0.002, -0.001]))
    state = gtsam.NavState(gtsam.Pose3(tilt, np.array([10.0, -5.0, 2.0])), tilt.rotate([1.0, 0.5, 0.0]))
    rng = np.random.default_rng(3)
    landmarks = [tilt.rotate(point) for point in rng.uniform(-8.0, 8.0, (7, 3))]
    noise = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.01, 0.01, 0.05]))
    for k in range(6):
        values.insert(X(k), state.pose())
        values.insert(V(k), state.velocity())
        values.insert(B(k), bias)
        for j, landmark in enumerate(landmarks):
            pose = state.pose()
            bearing, distance = pose.bearing(landmark), pose.range(landmark)
            graph.add(gtsam.BearingRangeFactor3D(X(k), L(j), bearing, distance, noise))
        if k < 5:
            steps = gtsam.PreintegratedCombinedMeasurements(params, bias)
            for step in range(40):
                push = np.array([np.sin(0.4 * step + k), 0.5 * np.cos(0.3 * step), 9.81 + 0.1 * k])
                steps.integrateMeasurement(push, np.array([0.3, -0.2 * k, 0.5 + 0.01 * step]), 0.02)
            graph.add(gtsam.CombinedImuFactor(X(k), V(k), X(k + 1), V(k + 1), B(k), B(k + 1), steps))
            state = steps.predict(state, bias)
    for j, landmark in enumerate(landmarks):
        values.insert(L(j), landmark)
    return graph, values


@pytest.mark.parametrize("tilt", [gtsam.Rot3(), gtsam.Rot3.Rodrigues(0.5, -0.8, 0.3)])
def test_inertial_graph_in_the_free_gauge(tilt: gtsam.Rot3) -> None:
    """Catches a bias or velocity in the wrong columns, a point taken for a velocity, gravity forgotten."""
    graph, values = inertial_graph(tilt)
    found = covariance(graph, values, gravity=tilt.rotate(np.array([0.0, 0.0, -9.81])))
    assert found.open == vg.YawTranslation().directions and not found.measured
    expected, at = dense(graph, values)
    for a in (X(2), V(2), B(2)):
        for b in (X(4), V(4), B(4), a):
            assert vg.relative_frobenius(found.block(a, b), expected[at[a], at[b]]) < 1e-8
    poses = found.keyframes(None, [X(2), X(4)], ["rotation", "position"])
    assert vg.relative_frobenius(poses[1], expected[at[X(4)], at[X(4)]]) < 1e-8
    blocks = found.landmarks(keys=[L(3), L(0)])
    assert vg.relative_frobenius(blocks[0], expected[at[L(3)], at[L(3)]]) < 1e-8
    np.testing.assert_array_equal(found.keyframes(kinds=["rotation", "position"])[[2, 4]], poses)
    held = found.in_gauge(vg.KeyframeGauge(X(3))).block(X(3), X(3))
    np.testing.assert_allclose(held[3:, 3:], 0.0, atol=1e-12)


def refused(graph: Any, values: Any, message: str) -> None:
    with pytest.raises(vg.DataError, match=message):
        covariance(graph, values)


def test_poses_are_saved_without_the_other_variables(tmp_path: Path) -> None:
    """Catches velocities and biases in the rows of poses, and GTSAM's order or side in the file."""
    found = covariance(*inertial_graph(gtsam.Rot3()))
    vg.save_trajectory(tmp_path / "poses.npz", found, gauge=vg.CentroidGauge())
    saved = vg.load_trajectory(tmp_path / "poses.npz")
    own = found.keyframes(vg.CentroidGauge(), [X(k) for k in range(6)], ["rotation", "position"])
    expected = vg.as_convention(own, saved.R_WB, source="gtsam", to="ros")
    np.testing.assert_allclose(saved.covariance, expected, rtol=1e-9, atol=1e-15)
    assert (saved.gauge, saved.keys) == ("centroid", ("x0", "x1", "x2", "x3", "x4", "x5"))
    vg.save_trajectory(tmp_path / "body.csv", found, gauge=vg.KeyframeGauge(X(2)), side="right")
    body, own = vg.load_trajectory(tmp_path / "body.csv"), found.keyframes(vg.KeyframeGauge(X(2)), to="right")
    np.testing.assert_allclose(body.sigma**2, np.einsum("kcc->kc", own), rtol=1e-9, atol=1e-15)
    assert (body.gauge, body.side, body.keys) == ("keyframe:x2", "right", saved.keys)
    vg.save_trajectory(tmp_path / "poses.tum", found, times_ns=np.arange(6))
    with pytest.raises(vg.DataError, match="such as vg.CentroidGauge"):
        vg.save_trajectory(tmp_path / "poses.csv", found, gauge="centroid")
    with pytest.raises(vg.DataError, match="keyframe x0: must have columns of .* say which kinds"):
        found.keyframes(vg.CentroidGauge())


def test_a_measured_pose_is_taken_as_it_is() -> None:
    graph, values = pose_graph()
    relative = covariance(graph, values).relative_pose(X(1), X(4))
    measured = values.atPose3(X(1)).between(values.atPose3(X(4))).retract(np.full(6, 0.1))
    expected = relative.mahalanobis(measured.matrix()).squared_distance
    assert expected > 0.1
    assert relative.mahalanobis(measured).squared_distance == pytest.approx(expected, rel=1e-9)


def test_an_audit_names_the_variables_of_a_graph() -> None:
    """Catches a prior left in that only shows as too small sigmas."""
    graph, values = inertial_graph(gtsam.Rot3())
    assert not information(graph, values).audit()
    graph.add(gtsam.PriorFactorPose3(X(2), values.atPose3(X(2)), gtsam.noiseModel.Isotropic.Sigma(6, 1e-4)))
    (concern,) = information(graph, values).audit()
    assert concern.kind == "prior" and "a prior on keyframe x2" in concern.sentence


def test_what_is_not_known_is_refused_by_name() -> None:
    graph, values = pose_graph()
    noise = gtsam.noiseModel.Isotropic.Sigma(3, 0.1)
    refused(graph.linearize(values), values, r"must be a gtsam.NonlinearFactorGraph \(found 'Gauss")
    refused(gtsam.NonlinearFactorGraph(), values, "must have poses")
    lone = gtsam.NonlinearFactorGraph(graph)
    lone.add(gtsam.PriorFactorPoint3(L(0), np.zeros(3), noise))
    refused(lone, values, "variable l0: must have every variable")
    values.insert(L(0), np.zeros(3))
    refused(lone, values, "variable l0: must be a velocity or a point .*no factor, or behind")
    turned = gtsam.NonlinearFactorGraph(graph)
    turned.add(gtsam.PriorFactorRot3(L(1), gtsam.Rot3(), noise))
    values.insert(L(1), gtsam.Rot3())
    refused(turned, values, r"variable l1: must be Pose3.*gtsam::Rot3")
    hard = gtsam.NonlinearFactorGraph(graph)
    hard.add(gtsam.PriorFactorPose3(X(0), values.atPose3(X(0)), gtsam.noiseModel.Constrained.All(6)))
    refused(hard, values, "row 10: must have no hard constraints")
    flat = gtsam.NonlinearFactorGraph(graph)
    flat.add(gtsam.PriorFactorPose2(L(2), gtsam.Pose2(), noise))
    values.insert(L(2), gtsam.Pose2())
    refused(flat, values, "must have poses: Pose3 .*or Pose2 alone")
