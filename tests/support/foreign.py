"""Estimates by other solvers' conventions: how they move, and matrices with a known null space."""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse

from vigauge.gauge.group import Group
from vigauge.gauge.layout import Layout, null_space
from vigauge.geometry import so3
from vigauge.geometry.so3 import Array


@dataclass(frozen=True)
class Estimate:
    R: Array
    p: Array
    v: Array
    X: Array

    @property
    def args(self) -> tuple[tuple[Array, Array], Array, Array]:
        return (self.R, self.p), self.v, self.X


def random_estimate(
    count: int, points: int, rng: np.random.Generator, origin: Array | float = 0.0
) -> Estimate:
    return Estimate(
        so3.exp(rng.normal(0.0, 1.5, (count, 3))),
        origin + rng.normal(0.0, 4.0, (count, 3)) + np.arange(count)[:, None],
        rng.normal(0.0, 1.0, (count, 3)),
        origin + rng.normal(0.0, 8.0, (points, 3)),
    )


def moved(at: Estimate, turn: Array, shift: Array, scale: float) -> Estimate:
    """The whole estimate turned, scaled and shifted, the turn about the mean position."""
    R, c = so3.exp(turn), at.p.mean(axis=0)
    return Estimate(
        R @ at.R,
        scale * (at.p - c) @ R.T + c + shift,
        scale * at.v @ R.T,
        scale * (at.X - c) @ R.T + c + shift,
    )


def quaternion_product(a: Array, b: Array) -> Array:
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


def half_angles(d: Array) -> Array:
    """Ceres' quaternion manifold: the increment is an axis times half an angle."""
    size = np.linalg.norm(d)
    return np.array([np.cos(size), *(np.sinc(size / np.pi) * d)])


def vector_part(d: Array) -> Array:
    """g2o's: the increment is the vector part of a quaternion."""
    return np.array([np.sqrt(1.0 - d @ d), *d])


def retracted_pose(side: str, R: Array, p: Array, dp: Array, dphi: Array) -> tuple[Array, Array]:
    """A pose after an increment, as each estimator writes it in its own terms."""
    if side == "left":
        return so3.exp(dphi) @ R, p + dp
    if side == "right":
        return R @ so3.exp(dphi), p + dp
    if side == "gtsam":
        return R @ so3.exp(dphi), p + R @ so3.left_jacobian(dphi) @ dp
    if side == "se3":
        return so3.exp(dphi) @ R, so3.exp(dphi) @ p + so3.left_jacobian(dphi) @ dp
    if side == "ceres":
        return so3.from_quaternion(quaternion_product(half_angles(dphi), so3.quaternion(R))), p + dp
    if side == "g2o":
        return so3.from_quaternion(quaternion_product(so3.quaternion(R), vector_part(dphi))), p + R @ dp
    assert side == "colmap"
    q, t = so3.quaternion(R.T), -R.T @ p
    R_CW = so3.from_quaternion(quaternion_product(half_angles(dphi), q))
    return R_CW.T, -R_CW.T @ (t + dp)


def retracted(layout: Layout, at: Estimate, delta: Array) -> Estimate:
    R, p, v, X = (part.copy() for part in (at.R, at.p, at.v, at.X))
    for k in range(layout.n_keyframes):
        step = {kind: delta[columns[k]] for kind, columns in layout.blocks.items()}
        R[k], p[k] = retracted_pose(layout.side, R[k], p[k], step["position"], step["rotation"])
        if "velocity" in step:
            v[k] += step["velocity"]
    return Estimate(R, p, v, X + delta[layout.points])


def graph_jacobian(
    layout: Layout, T: Array, rng: np.random.Generator, *, reach: int = 2, loops: int = 0
) -> scipy.sparse.csr_array:
    """Random measurements of neighbours (and of far pairs, and points) that do not see ``T`` (n, d)."""
    N, K = layout.n_keyframes, layout.n_points
    pairs = [(i, i + d) for d in range(1, reach + 1) for i in range(N - d)]
    pairs += [tuple(sorted(rng.choice(N, 2, replace=False))) for _ in range(loops)]
    sets = [np.concatenate([layout.columns(i), layout.columns(j)]) for i, j in pairs]
    for k in range(K):
        first = int(rng.integers(0, max(N - 2, 1)))
        seen = range(first, min(first + 3, N))
        poses = [layout.blocks[kind][i] for i in seen for kind in ("position", "rotation")]
        sets.append(np.concatenate([*poses, layout.points[k]]))
    rows, columns, values, count = [], [], [], 0
    for own in sets:
        basis, _ = np.linalg.qr(T[own])
        J = rng.standard_normal((len(own), len(own)))
        J -= (J @ basis) @ basis.T
        row, column = np.meshgrid(np.arange(len(own)), own, indexing="ij")
        rows.append(count + row.ravel())
        columns.append(column.ravel())
        values.append(J.ravel())
        count += len(own)
    parts = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return scipy.sparse.csr_array(parts, shape=(count, layout.n))


def problem(
    layout: Layout, group: Group, rng: np.random.Generator, **how: int
) -> tuple[Estimate, Array, scipy.sparse.csr_array]:
    """An estimate of a layout, the directions of its gauge, and a Jacobian that does not see them."""
    at = random_estimate(layout.n_keyframes, layout.n_points, rng)
    T = null_space(layout, *at.args, group=group)
    return at, T, graph_jacobian(layout, T, rng, **how)


def shifted(at: Estimate, origin: Array) -> Estimate:
    return replace(at, p=at.p + origin, X=at.X + origin)
