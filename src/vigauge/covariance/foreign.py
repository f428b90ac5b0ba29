"""The covariance of anyone's estimate from its information matrix."""

from __future__ import annotations

import numpy as np
import scipy.linalg.lapack as lapack

from ..arrays import reals, symmetric
from ..errors import DataError, DegenerateError
from ..geometry.so3 import Array
from ..observability.spectrum import require_regular, require_semidefinite
from ..sparsity.rounding import NOTHING, rounding
from .projection import independent_columns, oblique_projection

# Largest relative error of a covariance that may come from U being null to a few digits only.
_HARMLESS = 1e-3


def generalised_inverse(matrix: Array, null: Array) -> tuple[Array, Array]:
    """G with A G A = A, where ``null`` (n, d) spans the null space of A, and a well-conditioned basis of it.

    G = (A + N N^T)^-1 - N N^T with A scaled to a unit diagonal and N orthonormal in that scale, so units,
    scale and origin do not matter.

    Raises DataError, IndefiniteError and DegenerateError as :func:`covariance_from_hessian`.
    """
    n, diagonal = len(matrix), np.diagonal(matrix)
    if not np.all(diagonal > NOTHING):
        row = int(np.argmin(diagonal))
        raise DataError("H", "diagonal must be positive", row=row, value=float(diagonal[row]))
    scale = 1.0 / np.sqrt(diagonal)
    A = matrix * scale[:, None] * scale
    N = independent_columns("U", null / scale[:, None])
    A_N = A @ N
    # Information along U: above rounding it is somebody's measurement, however little it is next to the rest.
    along = float(np.abs(np.linalg.eigvalsh(N.T @ A_N)).max(initial=0.0))
    if along > rounding(n):
        raise _not_null(A, A_N, along, "")
    try:
        factor = np.linalg.cholesky(A + N @ N.T)
    except np.linalg.LinAlgError as error:
        require_semidefinite(A)
        raise DegenerateError("more than the gauge is unobservable: H is singular beyond U") from error
    half, _ = lapack.dtrtri(factor, lower=1)
    trace = float(np.vdot(half, half))
    require_regular(trace, n)
    leak = float(np.linalg.norm(A_N))
    if leak * trace > _HARMLESS:
        raise _not_null(A, A_N, leak, f", where the weakest of the other directions has {n / trace:.0e}")
    half *= scale
    N = N * scale[:, None]
    return half.T @ half - N @ N.T, N


def _not_null(A: Array, A_N: Array, found: float, against: str) -> DataError:
    """What to say of a U that H measures. Raises IndefiniteError where H is no information matrix."""
    require_semidefinite(A)
    return DataError(
        "U",
        f"columns must be in the null space of H, which has {found:.0e} of its diagonal along them{against}."
        " Something absolute is in H (a prior?): take it out, or invert H if that measures every direction."
        " Or U belongs to another estimate, or has too few digits (take both about a local origin)",
    )


def covariance_from_hessian(H: Array, U: Array, V: Array | None = None) -> Array:
    """Covariance in the gauge with normal V from any estimator's singular Hessian.

    All is judged after scaling H to a unit diagonal. Along U it may have no information but rounding
    errors, and what U lacks in digits must be small next to the weakest of the other directions.

    Parameters
    ----------
    H : (n, n) information matrix with null space spanned by U
    U : (n, d) null directions (4 for visual-inertial, 7 for monocular problems)
    V : (n, d) constraint normals of the gauge; None for the pseudo-inverse (V = U). That of a Schur
        complement is not the free gauge of the whole, which :meth:`Covariance.from_schur` gives

    Raises
    ------
    DataError
        for other shapes, numbers that are not finite, an H that is not symmetric; where columns of U, or of
        V, are dependent, or H has information along U (a soft prior, say)
    IndefiniteError
        where H has a negative eigenvalue
    DegenerateError
        where H has further null directions, or the constraints leave part of the orbit free
    """
    H = symmetric("H", H)
    U = reals("U", U, (len(H), "d"), matrix=True)
    V = None if V is None else reals("V", V, U.shape, matrix=True)
    G, U = generalised_inverse(H, U)
    return oblique_projection(G, U, U if V is None else independent_columns("V", V))
