"""The null space of a large sparse information matrix, and its smallest eigenvalues, in little memory."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import eye_array
from scipy.sparse.linalg import eigsh, splu, spsolve_triangular

from ..errors import DegenerateError, IndefiniteError
from ..geometry.so3 import Array
from ..sparsity.rounding import rounding
from .spectrum import NullSpace, indefinite, is_null, unit_scale

# Directions beyond the expected ones that are looked for at first.
_MORE = 8
# Null directions up to which they are named: as many dense columns are kept.
_MOST = 500
# Relative change of the smallest eigenvalue that is not zero, at which it is good enough for the gap.
_STEADY = 1e-3
_STEPS = 30


class SparseNullSpace(NullSpace):
    """As :class:`NullSpace` of a scipy.sparse matrix (n, n) in compressed columns, by inverse iteration.

    ``eigenvalues`` and ``vectors`` are the smallest only: all that are zero to rounding, and the next.
    ``expected`` (n, d) are directions to begin with. Raises IndefiniteError where there is a negative
    eigenvalue, and DegenerateError where more than 500 are zero.
    """

    def __init__(self, matrix: Any, expected: Array) -> None:
        empty = np.flatnonzero(matrix.diagonal() == 0.0)
        if len(empty) > _MOST:
            raise _too_many(f"{len(empty)} columns of H have no information, the first is {empty[0]}")
        self.scale = unit_scale(matrix.diagonal())
        A = 0.5 * (matrix + matrix.T).tocsc()
        A.data /= self.scale[A.indices] * np.repeat(self.scale, np.diff(A.indptr))
        n, rng = A.shape[0], np.random.default_rng(0)
        first = rng.standard_normal(n)
        (top,) = eigsh(A, 1, which="LA", v0=first, tol=_STEADY, return_eigenvectors=False)
        largest = max(float(top), 1.0)
        factor, known = _factor(A, rounding(n) * largest), expected * self.scale[:, None]
        more = _MORE
        while True:
            start = np.concatenate([known, rng.standard_normal((n, more))], axis=1)
            values, vectors = _smallest(A, factor, start, largest)
            if not is_null(values, n, largest).all():
                break
            if more > _MOST:
                raise _too_many(f"H has {len(values)} or more without information")
            more *= 2
        self._keep(A, values, vectors, largest)


def _factor(A: Any, shift: float) -> Any:
    """A plus ``shift`` on its diagonal, factorised; IndefiniteError where it is not positive."""
    order: dict[str, Any] = {
        "permc_spec": "MMD_AT_PLUS_A",
        "options": {"SymmetricMode": True, "Equil": False},
    }
    try:
        lu = splu((A + shift * eye_array(A.shape[0])).tocsc(), diag_pivot_thresh=0.0, **order)
    except RuntimeError as error:
        raise IndefiniteError("H is not positive semidefinite: a pivot is zero where none may be") from error
    pivots = lu.U.diagonal()
    if np.any(pivots <= 0.0):
        # Of the first of them: with L^T x = e, x^T A x is the pivot.
        x = np.zeros(len(pivots))
        x[np.argmax(pivots <= 0.0)] = 1.0
        x = spsolve_triangular(lu.L.T.tocsr(), x, lower=False)[lu.perm_c]
        x /= np.linalg.norm(x)
        raise indefinite(float(x @ (A @ x)), x)
    return lu


def _smallest(A: Any, factor: Any, start: Array, largest: float) -> tuple[Array, Array]:
    """Eigenvalues and vectors by inverse iteration: as many as ``start`` (n, c) has columns, up to the first
    that is not zero, which is good to 1e-3."""
    X, before = start, np.inf
    for _ in range(_STEPS):
        X = np.linalg.qr(factor.solve(np.linalg.qr(X)[0]))[0]
        values, turn = np.linalg.eigh(X.T @ (A @ X))
        X = X @ turn
        count = int(is_null(values, A.shape[0], largest).sum())
        first = float(values[count]) if count < len(values) else 0.0
        if abs(first - before) <= _STEADY * first:
            break
        before = first
    return values[: count + 1], X[:, : count + 1]


def _too_many(found: str) -> DegenerateError:
    return DegenerateError(
        f"more than {_MOST} directions are unobservable, too many to name ({found}): take out what nothing"
        " measures, and diagnose parts that nothing joins one by one"
    )
