"""Cameras from a Schur complement, and how many digits agree with a dense oracle."""

from __future__ import annotations

from typing import Any

import numpy as np

import vigauge as vg
from vigauge.geometry.so3 import Array

from .foreign_problems import Chain, bundle, chain
from .foreign_rows import Sizes, covariance_of, least, row
from .results import Row

_GROUPS: tuple[tuple[Any, Any], ...] = (
    (vg.YawTranslation(), vg.CentroidGauge()),
    (vg.Euclidean(), vg.CentroidGauge()),
    (vg.Similarity(), (vg.FixedGauge(), vg.Distance(0, 3))),
)


def camera_rows(sizes: Sizes) -> list[Row]:
    """Cameras of a bundle adjustment, from its Schur complement."""
    problem = bundle(sizes.cameras, sizes.points, sizes.observations)
    n, layout = len(problem.S), problem.layout
    gauge = (vg.FixedGauge(), vg.Distance(0, 3))
    V = vg.gauge_normal(layout, problem.poses, gauge, group=vg.Similarity())

    def pseudo_inverse() -> Array:
        G = np.linalg.pinv(problem.S, rcond=1e-12, hermitian=True)
        T = vg.null_space(layout, problem.poses, group=vg.Similarity())
        P = np.eye(n) - T @ np.linalg.solve(V.T @ T, V.T)
        whole = (P @ G @ P.T).reshape(n // 9, 9, n // 9, 9)
        return np.einsum("iajb->ijab", whole)[np.arange(n // 9), np.arange(n // 9)]

    def from_schur(parts: dict[str, Any]) -> Array:
        return vg.Covariance.from_schur(problem.S, layout, problem.poses, **parts).keyframes(gauge)

    case, what = f"{sizes.cameras} cameras, 7 directions", "all 9 x 9 blocks of S alone"
    note = f"first pose and a distance held; {sizes.points} points, {sizes.observations} images"
    peer, theirs = "numpy pinv of S", least(pseudo_inverse)
    alone = least(lambda: from_schur({"group": vg.Similarity()}))
    whole = least(lambda: from_schur(problem.arguments))
    rows = [row(case, what, alone, peer, theirs, note)]
    what, note = "all 9 x 9 blocks, points taken in", f"{note}; the peer has no points"
    return [*rows, row(case, what, whole, peer, theirs, note)]


def agreement_rows(sizes: Sizes) -> list[Row]:
    """The whole covariance in a gauge, against singular vectors of the dense Jacobian, never squared."""
    rows = []
    for group, gauge in _GROUPS:
        problem = chain(sizes.oracle, group)
        J = problem.jacobian()
        H, d = (J.T @ J).tocsc(), problem.T.shape[1]
        V = vg.gauge_normal(problem.layout, problem.poses, gauge, group=group)

        def oracle(J: Any = J, d: int = d, T: Array = problem.T, V: Array = V) -> Array:
            _, s, rows = np.linalg.svd(J.toarray(), full_matrices=False)
            half = rows[:-d].T / s[:-d]
            half -= T @ np.linalg.solve(V.T @ T, V.T @ half)
            return half @ half.T

        def whole(problem: Chain = problem, H: Any = H, gauge: Any = gauge) -> Array:
            return covariance_of(problem, H).matrix(gauge)

        note = f"{type(group).__name__}, gauge {getattr(gauge, 'name', 'first pose and a distance')}"
        case, what = f"{d} directions, n = {H.shape[0]}", "the whole matrix"
        rows.append(row(case, what, least(whole), "dense SVD of J", least(oracle), note))
    return rows
