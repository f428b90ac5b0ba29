"""The oblique projection that takes a covariance from one gauge to another, Eqs. (12) and (14)."""

from __future__ import annotations

import numpy as np
import scipy.linalg.lapack as lapack

from ..arrays import reals, symmetric
from ..errors import DataError, DegenerateError
from ..geometry.so3 import Array

# Entries of the inverse of V^T U, scaled to entries of one: beyond this half of the digits are gone.
_LARGEST_INVERSE = 1e8
# Largest part of H U, or of H cov H - H, in units of the standard deviations, that is an error of rounding.
_FOREIGN = 1e-6


def times_inverse(U: Array, V_T_U: Array) -> Array:
    """U (V^T U)^-1. Raises DegenerateError where the constraints leave part of the orbit free."""
    _, _, transposed, info = lapack.dgesv(V_T_U.T, U.T)
    if info > 0 or not _solves(V_T_U):
        raise DegenerateError("the gauge's constraints leave part of the gauge free")
    return transposed.T


def _solves(square: Array) -> bool:
    """Whether a small matrix has an inverse of six digits, its rows and columns in any units."""
    for axis in (1, 0):
        square = square / np.abs(square).max(axis=axis, keepdims=True, initial=np.finfo(float).tiny)
    _, _, inverse, info = lapack.dgesv(square, np.eye(len(square)))
    return info == 0 and bool(np.abs(inverse).max(initial=0.0) < _LARGEST_INVERSE)


def low_rank_projection(G: Array, G_V: Array, V_G_V: Array, U: Array, V_T_U: Array) -> Array:
    """Q G Q^T from G, G V and V^T G V, for any number of constraints."""
    W = times_inverse(U, V_T_U)
    cross = (G_V - 0.5 * W @ V_G_V) @ W.T
    out = G - cross - cross.T
    return 0.5 * (out + out.T)


def project_covariance(covariance: Array, U: Array, V: Array, *, H: Array | None = None) -> Array:
    """Q cov Q^T of Eqs. (12), (14) at one linearisation point, without forming Q.

    Parameters
    ----------
    covariance : (n, n) in any gauge
    U : (n, d) basis of the null space of H (the orbit's tangent), by the same increments as ``covariance``
    V : (n, d) normal of the gauge wanted
    H : (n, n) information matrix of the same parameters, for a test that all three belong together. A
        covariance alone does not say in which increments it is, and one of the free gauge looks like an
        information matrix: give H where you are not sure.

    Raises
    ------
    DataError
        for other shapes, numbers that are not finite, a covariance that is not symmetric or has a negative
        variance, and, with H, for U outside its null space or a covariance that is not of H
    DegenerateError
        where V leaves part of U's directions free
    """
    covariance = symmetric("covariance", covariance)
    n = len(covariance)
    U = reals("U", U, (n, "d"), matrix=True)
    V = reals("V", V, (n, U.shape[1]), matrix=True)
    if H is not None:
        _require_partners(symmetric("H", H, n), U, covariance)
    return projected(covariance, U, V)


def _require_partners(H: Array, U: Array, covariance: Array) -> None:
    """DataError where U is not in the null space of H, or H cov H is not H."""
    scale = np.sqrt(np.diagonal(H))
    unit = np.where(scale > 0.0, scale, 1.0)
    leak = np.linalg.norm((H @ U) / unit[:, None], axis=0)
    lost = leak > _FOREIGN * np.linalg.norm(unit[:, None] * U, axis=0)
    if lost.any():
        rule = "must be in the null space of H; are both by the same increments?"
        raise DataError("U", rule, field=f"column {int(np.argmax(lost))}")
    error = (H @ covariance @ H - H) / unit[:, None] / unit
    row, column = map(int, np.unravel_index(int(np.argmax(np.abs(error))), error.shape))
    if not abs(error[row, column]) < _FOREIGN:
        rule = "H cov H must be H; is it the information matrix, or by other increments than H?"
        raise DataError(
            "covariance", rule, row=row, field=f"column {column}", value=float(error[row, column])
        )


def projected(covariance: Array, U: Array, V: Array) -> Array:
    """Q cov Q^T of matrices that have been looked at, see :func:`project_covariance`."""
    covariance_V = covariance @ V
    return low_rank_projection(covariance, covariance_V, V.T @ covariance_V, U, V.T @ U)


def oblique_projector(U: Array, V: Array) -> Array:
    """(n, n) Q = I - U (V^T U)^-1 V^T of Eq. (14), dense: for small problems and tests."""
    return np.eye(len(U)) - U @ np.linalg.solve(V.T @ U, V.T)
