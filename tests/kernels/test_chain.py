"""The chain of velocities and biases in a dense motion system, against plain linear algebra."""

import numpy as np
import pytest

from vigauge.kernels import chain


def system(n: int, w: int) -> np.ndarray:
    """(n (w + 6),) squared: poses all meet, and both keyframes of neighbours."""
    rng = np.random.default_rng(10 * n + w)
    speed, pose = np.split(np.arange(n * (w + 6)), [n * w])
    speed, pose = speed.reshape(n, w), pose.reshape(n, 6)
    H = 0.1 * np.eye(n * (w + 6))
    groups = [pose.ravel(), *(np.concatenate([*speed[k : k + 2], *pose[k : k + 2]]) for k in range(n))]
    for group in groups:
        J = rng.normal(size=(len(group), len(group)))
        H[np.ix_(group, group)] += J.T @ J
    return H


def stored(H: np.ndarray) -> np.ndarray:
    """The lower triangle column by column; what lies above is not a number."""
    return np.where(np.tri(len(H), dtype=bool).T, H, np.nan).ravel()


@pytest.mark.parametrize("w", [3, 9])
@pytest.mark.parametrize("n", [1, 2, 3, 10])
def test_solution_and_factor_are_those_of_the_dense_matrix(n, w):
    """Catches fill that is lost from keyframe to keyframe, a panel that misses a pose, an entry above the
    diagonal that is read, and the last keyframe, which has no next one."""
    H = system(n, w)
    storage, scratch = stored(H), np.empty(6, dtype=np.int32)
    assert chain.is_chain(storage, len(H), w)
    assert chain.factorise(storage, len(H), w, scratch)
    L = np.linalg.cholesky(H)
    assert np.abs(np.tril(storage.reshape(H.shape).T) - L).max() < 1e-12 * np.abs(L).max()
    right = np.random.default_rng(0).normal(size=len(H))
    x = right.copy()
    chain.solve(storage, len(H), w, x, scratch)
    expected = np.linalg.solve(H, right)
    assert np.linalg.norm(x - expected) < 1e-11 * np.linalg.norm(expected)


@pytest.mark.parametrize(
    ("row", "column"), [(6, 0), (8, 2), (14, 5), (15 + 12, 0), (15 + 29, 8)], ids=lambda at: str(at)
)
def test_keyframes_that_are_no_neighbours_break_the_chain(row, column):
    """Catches a factor between velocities, or a velocity and a pose, that lie apart and would be left out."""
    n, w = 5, 3
    H = system(n, w)
    H[row, column] = H[column, row] = 1e-300
    assert not chain.is_chain(stored(H), len(H), w)
    H[row, column] = H[column, row] = np.nan
    assert not chain.is_chain(stored(H), len(H), w)


@pytest.mark.parametrize(
    ("at", "value"), [(0, -1.0), (8, np.nan), (20, -1.0), (35, np.nan), (4 * 9, -1.0), (4 * 15 - 1, -1.0)]
)
def test_a_pivot_that_is_not_positive_is_told(at, value):
    """Catches square roots of negative numbers in the chain or in the poses."""
    H = system(4, 9)
    H[at, at] = value
    assert not chain.factorise(stored(H), len(H), 9, np.empty(6, dtype=np.int32))
