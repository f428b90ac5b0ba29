"""Which sparse matrices count as symmetric, against the dense gate."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse

import vigauge as vg
from vigauge.arrays import symmetric
from vigauge.kernels.symmetric import exactly_symmetric
from vigauge.sparsity.symmetric import sparse_symmetric


def matrix(rng: np.random.Generator, n: int = 40) -> np.ndarray:
    """Positive definite with units of very different size, four in five entries zero."""
    half = scipy.sparse.random_array((n, n), density=0.1, rng=rng).toarray()
    size = 10.0 ** rng.uniform(-2.0, 2.0, n)
    A = (half @ half.T + np.eye(n)) * size * size[:, None]
    return np.tril(A) + np.tril(A, -1).T  # to the last bit


@pytest.mark.parametrize("stored", [True, False])
@pytest.mark.parametrize("seed", range(8))
def test_one_entry_is_off(stored: bool, seed: int) -> None:
    """Catches an entry compared with another than its partner, or with none where that is not stored."""
    rng = np.random.default_rng(seed)
    A = matrix(rng)
    taken, diagonal = sparse_symmetric("A", scipy.sparse.csr_array(A), 40)
    np.testing.assert_array_equal(taken.toarray(), A)
    np.testing.assert_array_equal(diagonal, np.diagonal(A))
    assert exactly_symmetric(taken.indptr, taken.indices, taken.data, np.zeros(40))
    i, j = rng.choice(np.argwhere((A != 0.0) == stored))
    if i == j:
        i, j = 0, 39
    allowed = 1e-8 * np.sqrt(A[i, i] * A[j, j])
    less, more = A.copy(), A.copy()
    less[i, j] += 0.9 * allowed
    more[i, j] += 1.1 * allowed
    symmetric("A", less)
    between = sparse_symmetric("A", scipy.sparse.csr_array(less), 40)[0].toarray()
    np.testing.assert_array_equal(between, 0.5 * (less + less.T))
    for gate, of in ((symmetric, more), (sparse_symmetric, scipy.sparse.csr_array(more))):
        with pytest.raises(vg.DataError, match=rf"row ({i}, column {j}|{j}, column {i})\b") as refusal:
            gate("A", of, 40)
        assert "must be symmetric" in str(refusal.value)


@pytest.mark.parametrize("triangle", [np.tril, np.triu])
def test_one_triangle_is_no_symmetric_matrix(triangle) -> None:
    """Catches entries without a partner that are never looked at, above or below the diagonal."""
    A = scipy.sparse.csc_array(triangle(matrix(np.random.default_rng(0))))
    assert not exactly_symmetric(A.indptr, A.indices, A.data, np.zeros(40))
    with pytest.raises(vg.DataError, match="must be symmetric"):
        sparse_symmetric("A", A, 40)
