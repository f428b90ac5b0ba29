"""Cameras from a Schur complement, and how many digits agree with a dense oracle."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

import vigauge as vg
from vigauge.geometry.so3 import Array

from .foreign_problems import Chain, bundle, chain
from .foreign_rows import REPEATS, Sizes, covariance_of, least, row, runs_of
from .long_double import pseudo_inverse
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
    rows = [row(case, what, alone, peer, theirs, note, to_reach="1 s")]
    what, note = "all 9 x 9 blocks, points taken in", f"{note}; the peer has no points"
    return [*rows, row(case, what, whole, peer, theirs, note, to_reach="1 s")]


def agreement_rows(sizes: Sizes) -> list[Row]:
    """The whole covariance in a gauge, against pseudo-inverses from the dense Jacobian, never squared."""
    rows = []
    for (group, gauge), (peer, (invert, count, repeats)) in product(_GROUPS, _ORACLES.items()):
        problem = chain(sizes.oracle // count, group)
        J, T = problem.jacobian(), problem.T
        H = (J.T @ J).tocsc()
        V = vg.gauge_normal(problem.layout, problem.poses, gauge, group=group)

        def oracle(invert: Any = invert, J: Any = J, T: Array = T, V: Array = V) -> Array:
            P = np.eye(len(T)) - T @ np.linalg.solve(V.T @ T, V.T)
            return np.asarray(P @ invert(J.toarray(), T) @ P.T, float)

        def whole(problem: Chain = problem, H: Any = H, gauge: Any = gauge) -> Array:
            return covariance_of(problem, H).matrix(gauge)

        note = f"{type(group).__name__}, gauge {getattr(gauge, 'name', 'first pose and a distance')}"
        case, what = f"{T.shape[1]} directions, n = {H.shape[0]}", "the whole matrix"
        rows.append(row(case, what, least(whole), peer, least(oracle, repeats), note, runs_of(repeats)))
    return rows


def _by_svd(J: Array, T: Array) -> Array:
    _, s, rows = np.linalg.svd(J, full_matrices=False)
    d = T.shape[1]
    half = rows[:-d].T / s[:-d]
    return half @ half.T


def _by_long_double(J: Array, T: Array) -> Any:
    return pseudo_inverse(J.astype(np.longdouble), T.astype(np.longdouble))


# How each inverts, what share of the size it takes, and how often it runs.
_ORACLES: dict[str, tuple[Any, int, int]] = {
    "dense SVD of J": (_by_svd, 1, REPEATS),
    "QR of J, long double": (_by_long_double, 2, 1),
}
