"""A pose graph of GTSAM's own factors: its information matrix by our layout, against its Marginals."""

import numpy as np
import pytest
import scipy.sparse

import vigauge as vg
from vigauge.covariance import information

gtsam = pytest.importorskip("gtsam")

pytestmark = pytest.mark.oracle

COUNT = 12
SIGMAS = np.array([0.01, 0.02, 0.03, 0.1, 0.05, 0.2])


def graph_and_values():
    """Poses on a helix, odometry, and loops, with errors that the estimate has taken up."""
    rng = np.random.default_rng(1)
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    poses = [
        gtsam.Pose3.Expmap(np.array([0.1 * k, 0.2, 0.5 * k, np.cos(k) * 5, np.sin(k) * 5, 0.3 * k]))
        for k in range(COUNT)
    ]
    noise = gtsam.noiseModel.Diagonal.Sigmas(SIGMAS)
    pairs = [(k, k + 1) for k in range(COUNT - 1)] + [(0, 5), (3, 11), (2, 9)]
    for i, j in pairs:
        measured = poses[i].between(poses[j]).compose(gtsam.Pose3.Expmap(SIGMAS * rng.standard_normal(6)))
        graph.add(gtsam.BetweenFactorPose3(i, j, measured, noise))
    for k, pose in enumerate(poses):
        values.insert(k, pose)
    prior = gtsam.NonlinearFactorGraph(graph)
    prior.add(gtsam.PriorFactorPose3(0, poses[0], gtsam.noiseModel.Isotropic.Sigma(6, 0.01)))
    best = gtsam.LevenbergMarquardtOptimizer(prior, values).optimize()
    return graph, prior, best


@pytest.mark.parametrize("sparse", [False, True])
def test_poses_and_relative_poses_are_those_of_marginals(
    sparse: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Catches a side, an order or a sign that agrees with our own tests and with nobody else."""
    monkeypatch.setattr(information, "_SMALL", 0)
    graph, prior, best = graph_and_values()
    H, _ = graph.linearize(best).hessian()
    layout = vg.Layout.by_keyframe(COUNT, ["rotation", "position"], side="gtsam")
    poses = np.array([best.atPose3(k).matrix() for k in range(COUNT)])
    given = scipy.sparse.csc_array(H) if sparse else H
    covariance = vg.Covariance.from_hessian(given, layout, poses, group=vg.Euclidean())
    assert covariance.open == vg.Euclidean().directions
    marginals = gtsam.Marginals(prior, best)
    blocks = covariance.keyframes(vg.FixedGauge())
    for k in range(1, COUNT):
        carried = best.atPose3(k).between(best.atPose3(0)).AdjointMap()
        expected = marginals.marginalCovariance(k) - 0.01**2 * carried @ carried.T
        assert vg.relative_frobenius(blocks[k], expected) < 1e-9
    joint = marginals.jointMarginalCovariance([2, 10]).fullMatrix()
    between = best.atPose3(2).between(best.atPose3(10))
    D = np.concatenate([-between.inverse().AdjointMap(), np.eye(6)], axis=1)
    relative = covariance.relative_pose(2, 10)
    np.testing.assert_allclose(relative.p, between.translation(), atol=1e-12)
    found = vg.as_convention(relative.covariance, relative.R, to="gtsam")
    assert vg.relative_frobenius(found, D @ joint @ D.T) < 1e-9
