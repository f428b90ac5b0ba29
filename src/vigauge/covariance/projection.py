"""The oblique projection that takes a covariance from one gauge to another, Eqs. (12) and (14)."""

from __future__ import annotations

import numpy as np
import scipy.linalg.lapack as lapack

from ..arrays import reals, symmetric
from ..errors import DataError, DegenerateError
from ..geometry.so3 import Array
from ..kernels import symmetric as symmetric_kernels
from ..observability.spectrum import DEPENDENT

# Digits that (V^T U)^-1 may lose: beyond, what is left of a variance is no number.
_LOST = 1e10

# Largest part of H U, or of H cov H - H, in units of the standard deviations, that is an error of rounding.
_FOREIGN = 1e-6


def along_orbit(U: Array, V: Array, rows: int | None = None) -> Array:
    """(n, d) U (V^T U)^-1: how the estimate moves on its orbit for one unit of each constraint of V.

    ``rows``: of the first parameters only.

    Whether V^T U is singular is judged by the digits that its inverse loses, which no change of units,
    scale or order of the columns alters. Raises DegenerateError where the constraints leave part of the
    orbit free.
    """
    if not U.size:
        return U[:rows]
    gram = V.T @ U
    inverse, info = lapack.dgetri(*lapack.dgetrf(gram)[:2])
    if V is U:  # the sums of |U|^T |U| are at most the products of the columns' lengths, and near them
        lost = symmetric_kernels.largest_ratio(inverse, gram)
    else:
        lost = float((np.abs(inverse) * (np.abs(U.T) @ np.abs(V))).max())
    if info or not lost < _LOST:
        raise DegenerateError("the gauge's constraints leave part of the gauge free")
    return U[:rows] @ inverse


def independent_columns(name: str, columns: Array) -> Array:
    """A basis of the span of ``columns`` (n, d) that is orthonormal to rounding, row by row exact.

    Far from the origin a turn is nearly a shift: products of such columns lose twice the digits that
    the columns do. Raises DataError where they are dependent.
    """
    if not columns.size:
        return columns
    length = np.abs(columns).max(axis=0)
    unit = columns / np.where(length > 0.0, length, 1.0)
    R = np.asarray(np.linalg.qr(unit, mode="r"))
    inverse, info = lapack.dtrtri(R) if len(R) == R.shape[1] else (R, 1)
    # Rows of the inverse, in units of R's columns: the largest is at most the condition of the directions.
    condition = np.sqrt(np.max(np.sum(R**2, axis=0) * np.sum(inverse**2, axis=1))) if not info else np.inf
    if not condition * DEPENDENT < 1.0:
        raise DataError(name, "columns must be independent", field="condition", value=float(condition))
    return unit @ inverse


def low_rank_projection(G: Array, G_V: Array, V_G_V: Array, W: Array) -> Array:
    """Q G Q^T from G, G V, V^T G V and W = U (V^T U)^-1, for any number of constraints."""
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
        and where the columns of U, or those of V, are dependent
    DegenerateError
        where the constraints of V leave part of the orbit free
    """
    covariance = symmetric("covariance", covariance)
    n = len(covariance)
    U = reals("U", U, (n, "d"), matrix=True)
    V = reals("V", V, (n, U.shape[1]), matrix=True)
    if H is not None:
        _require_partners(symmetric("H", H, n), U, covariance)
    return oblique_projection(covariance, independent_columns("U", U), independent_columns("V", V))


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


def oblique_projection(covariance: Array, U: Array, V: Array) -> Array:
    """As :func:`project_covariance`, with well-conditioned bases."""
    covariance_V = covariance @ V
    return low_rank_projection(covariance, covariance_V, V.T @ covariance_V, along_orbit(U, V))


def oblique_projector(U: Array, V: Array) -> Array:
    """(n, n) Q = I - U (V^T U)^-1 V^T of Eq. (14), dense: for small problems and tests."""
    return np.eye(len(U)) - U @ np.linalg.solve(V.T @ U, V.T)
