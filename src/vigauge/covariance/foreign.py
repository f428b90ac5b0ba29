"""The covariance of anyone's estimate from its information matrix."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from ..arrays import reals, symmetric
from ..errors import DataError, DegenerateError
from ..geometry.so3 import Array
from ..observability.spectrum import require_regular
from .projection import projected


def _inverse(matrix: Array) -> Array:
    """Inverse of a positive definite matrix, scaled to a unit diagonal first.

    Raises DegenerateError where the matrix is singular to rounding.
    """
    n = len(matrix)
    scale = 1.0 / np.sqrt(np.diagonal(matrix))
    try:
        factor = np.linalg.cholesky(matrix * scale[:, None] * scale)
    except np.linalg.LinAlgError as error:
        raise DegenerateError("the information matrix is not positive definite in this gauge") from error
    half = scipy.linalg.solve_triangular(factor, np.eye(n), lower=True, check_finite=False)
    require_regular(float(np.vdot(half, half)), n)
    half *= scale
    return half.T @ half


def inverse_on_complement(matrix: Array, null: Array) -> Array:
    """pinv(matrix) where ``null`` (n, d) spans its null space: (A + s N N^T)^-1 - N N^T / s.

    s sits in the middle of the spectrum: far from either end it costs digits.
    """
    N, _ = np.linalg.qr(null)
    s = float(np.exp(np.mean(np.log(np.diagonal(matrix)))))
    return _inverse(matrix + s * (N @ N.T)) - N @ N.T / s


def covariance_from_hessian(H: Array, U: Array, V: Array | None = None) -> Array:
    """Covariance in the gauge with normal V from any estimator's singular Hessian.

    Parameters
    ----------
    H : (n, n) information matrix with null space spanned by U
    U : (n, d) null directions (4 for visual-inertial, 7 for monocular problems)
    V : (n, d) constraint normals of the gauge; None for the pseudo-inverse (V = U)

    Raises
    ------
    DataError
        for other shapes, numbers that are not finite, an H that is not symmetric, or U outside its
        null space
    DegenerateError
        where H has further null directions
    """
    H = symmetric("H", H)
    U = reals("U", U, (len(H), "d"), matrix=True)
    V = U if V is None else reals("V", V, U.shape, matrix=True)
    scale = np.sqrt(np.diagonal(H))
    if not np.all(scale > 0):
        raise DataError(
            "H", "diagonal must be positive", row=int(np.argmin(scale)), value=float(scale.min()) ** 2
        )
    leak = np.linalg.norm((H @ U) / scale[:, None], axis=0) / np.linalg.norm(scale[:, None] * U, axis=0)
    if np.max(leak) > 1e-6:
        raise DataError(
            "U",
            "must be in the null space of H",
            field=f"column {int(np.argmax(leak))}",
            value=float(leak.max()),
        )
    G = inverse_on_complement(H, U)
    return projected(G, U, V)
