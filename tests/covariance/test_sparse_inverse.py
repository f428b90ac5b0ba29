"""Chosen entries of a sparse inverse against the dense one."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sparse

import vigauge as vg
from vigauge.covariance.sparse_inverse import SparseInverse
from vigauge.kernels import elimination
from vigauge.sparsity.symmetric import sparse_symmetric


def scattered(loops: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A positive definite matrix of 60 nodes of one to five columns, in any order, and the node of each."""
    node = rng.permutation(np.repeat(np.arange(60), rng.integers(1, 6, 60)))
    pairs = [np.stack([np.arange(58), np.arange(2, 60)], axis=1), rng.integers(0, 60, (loops, 2))]
    A = np.diag(rng.uniform(0.5, 2.0, len(node)))
    for i, j in np.concatenate(pairs):
        at = np.flatnonzero((node == i) | (node == j))
        B = rng.standard_normal((len(at), len(at)))
        A[np.ix_(at, at)] += B @ B.T
    return A, node


@pytest.mark.parametrize("loops", [0, 10, 1000])
def test_every_answer_is_that_of_the_dense_inverse(loops: int) -> None:
    """Catches wrong fronts, rows or paths: two trees, loops, a full matrix; a node that is held whole."""
    rng = np.random.default_rng(loops)
    A, node = scattered(loops, rng)
    held = np.append(np.flatnonzero(node == 7), np.flatnonzero(node == 30)[:1])
    keep = np.setdiff1d(np.arange(len(A)), held)
    scale = rng.uniform(0.1, 10.0, len(A))
    found = SparseInverse(sparse.csc_array(A / scale[:, None] / scale), scale, node, held)
    G = np.zeros_like(A)
    G[np.ix_(keep, keep)] = np.linalg.inv(A[np.ix_(keep, keep)])
    every, some = np.arange(len(A)), rng.permutation(len(A))[:40]
    B = rng.standard_normal((len(A), 3))
    own = np.array([np.resize(np.flatnonzero(node == k), 5) for k in range(60)])
    far = some.reshape(-1, 4)
    size = np.abs(G).max()
    for one, other in (
        (found.times(B), G @ B),
        (found.across(every, some), G[:, some]),
        (found.blocks(own), G[own[:, :, None], own[:, None, :]]),
        (found.blocks(far), G[far[:, :, None], far[:, None, :]]),
    ):
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-12 * size)
    np.testing.assert_allclose(found.log_det, np.linalg.slogdet(A[np.ix_(keep, keep)])[1], rtol=1e-12)
    largest = np.linalg.eigvalsh(G)[-1]
    assert found.below((1.0 + 1e-12) * largest) and not found.below(0.5 * largest)


def test_entries_of_one_triangle_only_are_no_trap() -> None:
    """Catches an elimination that follows the upper triangle in one place and the lower in another. Tiny
    entries without a partner pass as symmetric, and fronts would lose shares or write past their memory."""
    rng = np.random.default_rng(0)
    A, node = scattered(0, rng)
    one = sparse.lil_array(A)
    for i, j in rng.integers(0, len(A), (400, 2)):
        if A[i, j] == 0.0:
            one[i, j] = 1e-12
    H, _ = sparse_symmetric("H", one.tocsc(), len(A))
    found = SparseInverse(H, np.ones(len(A)), node, np.empty(0, dtype=np.int64))
    B = rng.standard_normal((len(A), 3))
    np.testing.assert_allclose(found.times(B), np.linalg.solve(A, B), rtol=0.0, atol=1e-9)


def test_a_negative_eigenvalue_is_told_from_a_singular_matrix() -> None:
    """Catches pivots of rounding size that pass for a matrix that is no sum of squares."""
    A, node = scattered(5, np.random.default_rng(3))
    scale = 1.0 / np.sqrt(np.diagonal(A))
    w = np.random.default_rng(4).standard_normal(len(A))
    none = np.empty(0, dtype=np.int64)

    def refuse(share: float, error: type[Exception], words: str) -> None:
        H = A - share * np.outer(w, w) / (w @ np.linalg.solve(A, w))
        with pytest.raises(error, match=words):
            SparseInverse(sparse.csc_array(H), scale, node, none)

    refuse(1.0, vg.DegenerateError, "more is unobservable")
    refuse(1.01, vg.IndefiniteError, r"a pivot of -\d.* of its diagonal at column \d+")


@pytest.mark.parametrize(("steps", "paired"), [((1, 2), True), ((1, 10), False)])
def test_only_nodes_with_the_same_neighbours_are_ordered_in_pairs(
    steps: tuple[int, int], paired: bool
) -> None:
    """Catches pairs in a grid, whose factor they fill up, and none in a chain of keyframes that overlap."""
    ones = [np.ones(60 - step) for step in (0, *steps, *steps)]
    graph = sparse.csc_array(sparse.diags_array(ones, offsets=[0, *steps, *(-step for step in steps)]))
    number = elimination.pairs(graph.indptr, graph.indices)
    np.testing.assert_array_equal(number[2:-2], np.arange(2, 58) // 2 if paired else np.arange(2, 58))
