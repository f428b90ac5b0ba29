"""Random information matrices with exactly the null space of real ones: chains of keyframes, and bundles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import gtsam
import numpy as np
import scipy.sparse as sparse

import vigauge as vg
from vigauge.gauge.layout import Index
from vigauge.geometry import so3
from vigauge.geometry.so3 import Array

BLOCKS = ("rotation", "position", "velocity")


@dataclass(frozen=True)
class Chain:
    """Keyframes of nine columns, measured in pairs (m, 2) by J (m, 18, 18); T (n, d) is what no row sees."""

    layout: vg.Layout
    group: Any
    poses: tuple[Array, Array]
    velocities: Array
    T: Array
    pairs: Index
    J: Array

    @property
    def columns(self) -> Index:
        """(m, 18) of the whole."""
        return (9 * self.pairs[:, :, None] + np.arange(9)).reshape(len(self.pairs), 18)

    def jacobian(self) -> Any:
        rows = np.broadcast_to(np.arange(self.J[..., 0].size).reshape(-1, 18, 1), self.J.shape)
        columns = np.broadcast_to(self.columns[:, None], self.J.shape)
        return sparse.csr_array((self.J.ravel(), (rows.ravel(), columns.ravel())))


def circle(count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """R (N, 3, 3), p (N, 3): laps of a hundred keyframes, slowly rising, with any rotations."""
    turn = 2.0 * np.pi * np.arange(count) / 100.0
    p = np.stack([10.0 * np.cos(turn), 10.0 * np.sin(turn), 0.2 * turn], axis=1)
    return so3.exp(rng.normal(0.0, 1.0, (count, 3))), p


def chain(count: int, group: Any, *, loops: int = 5, seed: int = 1) -> Chain:
    """Each keyframe is tied to the next two, and a few to ones far off."""
    rng = np.random.default_rng(seed)
    poses, v = circle(count, rng), rng.standard_normal((count, 3))
    layout = vg.Layout.by_keyframe(count, BLOCKS)
    T = vg.null_space(layout, poses, v, group=group)
    far = rng.integers(0, count - 3, loops)
    near = [np.stack([np.arange(count - d), np.arange(d, count)], axis=1) for d in (1, 2)]
    pairs = np.concatenate([*near, np.stack([far, rng.integers(far + 3, count)], axis=1)])
    seen = T.reshape(count, 9, -1)[pairs].reshape(len(pairs), 18, -1)
    Q, _ = np.linalg.qr(seen)
    J = rng.standard_normal((len(pairs), 18, 18))
    return Chain(layout, group, poses, v, T, pairs, J - (J @ Q) @ Q.swapaxes(1, 2))


@dataclass(frozen=True)
class Bundle:
    """Cameras of nine columns, points eliminated; ``arguments`` are the rest for from_schur."""

    S: Array
    layout: vg.Layout
    poses: tuple[Array, Array]
    arguments: dict[str, Any]


def bundle(cameras: int, points: int, observations: int, *, seed: int = 2) -> Bundle:
    """Images of points in cameras with three intrinsics each; seven directions are open."""
    rng = np.random.default_rng(seed)
    poses, X = circle(cameras, rng), rng.normal(0.0, 8.0, (points, 3))
    columns = 9 * np.arange(cameras)[:, None] + np.arange(9)
    kinds = {"rotation": columns[:, :3], "position": columns[:, 3:6], "intrinsics": columns[:, 6:]}
    layout = vg.Layout(9 * cameras, kinds)
    T = vg.null_space(layout.with_points(points), poses, None, X, group=vg.Similarity())
    # Every point is seen by three cameras at least, the rest of the images at random.
    spread = rng.permuted(np.tile(np.arange(cameras), (points, 1)), axis=1)[:, :3].ravel()
    more = observations - 3 * points
    camera = np.concatenate([spread, rng.integers(0, cameras, more)])
    point = np.concatenate([np.repeat(np.arange(points), 3), rng.integers(0, points, more)])
    at_camera, at_point = T[: 9 * cameras].reshape(cameras, 9, 7), T[9 * cameras :].reshape(points, 3, 7)
    seen = np.concatenate([at_camera[camera, :6], at_point[point]], axis=1)
    # Two rows are all that is orthogonal to seven directions in nine columns.
    J = rng.standard_normal((observations, 2, 2)) @ np.linalg.svd(seen)[0][:, :, 7:].swapaxes(1, 2)
    own = np.concatenate([J[:, :, :6], rng.standard_normal((observations, 2, 3))], axis=2)

    def whole(part: Array, at: Index, count: int) -> Any:
        blocks = sparse.bsr_array((part, at, np.arange(observations + 1)), shape=(2 * observations, count))
        return blocks.tocsr()

    A, P = whole(own, camera, 9 * cameras), whole(J[:, :, 6:], point, 3 * points)
    B = (A.T @ P).tocsr()
    C = np.zeros((points, 3, 3))
    np.add.at(C, point, J[:, :, 6:].swapaxes(1, 2) @ J[:, :, 6:])
    inverse = sparse.bsr_array((np.linalg.inv(C), np.arange(points), np.arange(points + 1)))
    S = (A.T @ A - B @ inverse @ B.T).toarray()
    rest = {"points": X, "coupling": B, "information": C, "group": vg.Similarity()}
    return Bundle(0.5 * (S + S.T), layout, poses, rest)


def pose_graph(count: int) -> tuple[Any, Any]:
    """A chain of GTSAM's own BetweenFactorPose3 and its values, without a prior."""
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    noise = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.01, 0.02, 0.03, 0.1, 0.05, 0.2]))
    R, p = circle(count, np.random.default_rng(3))
    poses = [gtsam.Pose3(gtsam.Rot3(R[k]), p[k]) for k in range(count)]
    for k, pose in enumerate(poses):
        values.insert(gtsam.symbol("x", k), pose)
        if k:
            between = poses[k - 1].between(pose)
            graph.add(
                gtsam.BetweenFactorPose3(gtsam.symbol("x", k - 1), gtsam.symbol("x", k), between, noise)
            )
    return graph, values
