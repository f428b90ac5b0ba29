"""The oblique projection that takes a covariance from one gauge to another, Eqs. (12) and (14)."""

from __future__ import annotations

import numpy as np
import scipy.linalg.lapack as lapack

from ..errors import DegenerateError
from ..geometry.so3 import Array


def times_inverse(U: Array, V_T_U: Array) -> Array:
    """U (V^T U)^-1. Raises DegenerateError where the constraints leave part of the orbit free."""
    _, _, transposed, info = lapack.dgesv(V_T_U.T, U.T)
    if info > 0:
        raise DegenerateError("the gauge's constraints leave part of the gauge free")
    return transposed.T


def low_rank_projection(G: Array, G_V: Array, V_G_V: Array, U: Array, V_T_U: Array) -> Array:
    """Q G Q^T from G, G V and V^T G V, for any number of constraints."""
    W = times_inverse(U, V_T_U)
    cross = (G_V - 0.5 * W @ V_G_V) @ W.T
    out = G - cross - cross.T
    return 0.5 * (out + out.T)


def project_covariance(covariance: Array, U: Array, V: Array) -> Array:
    """Q cov Q^T of Eqs. (12), (14) at one linearisation point, without forming Q.

    Parameters
    ----------
    covariance : (n, n) in any gauge
    U : (n, d) basis of the null space of H (the orbit's tangent)
    V : (n, d) normal of the gauge wanted
    """
    covariance_V = covariance @ V
    return low_rank_projection(covariance, covariance_V, V.T @ covariance_V, U, V.T @ U)


def oblique_projector(U: Array, V: Array) -> Array:
    """(n, n) Q = I - U (V^T U)^-1 V^T of Eq. (14), dense: for small problems and tests."""
    return np.eye(len(U)) - U @ np.linalg.solve(V.T @ U, V.T)
