"""Least squares with 18 digits, in plain NumPy: an oracle that says which of two results in double is off.

Where a long double is a double, it is good to 1e-12 still: no difference is taken, and nothing is squared.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

Long = np.ndarray[Any, np.dtype[np.longdouble]]


def jacobian(residuals: Callable[[Any], Any], n: int) -> Long:
    """(m, n) at zero, by complex steps: no difference is taken, so no digit is lost."""
    step = np.longdouble(1e-40)
    columns = []
    for k in range(n):
        delta = np.zeros(n, np.clongdouble)
        delta[k] = 1j * step
        columns.append(residuals(delta).imag / step)
    return np.stack(columns, axis=1)


def turned(delta: Any) -> Any:
    """(..., 3, 3) I + hat(delta): what exp(delta) is to a complex step."""
    x, y, z = np.moveaxis(delta, -1, 0)
    i = np.ones_like(x)
    return np.stack([i, -z, y, z, i, -x, -y, x, i], axis=-1).reshape(*x.shape, 3, 3)


def triangle(A: Long) -> Long:
    """R (n, n) of A = Q R (m, n), by Householder reflections."""
    R = np.array(A, np.longdouble)
    n = R.shape[1]
    for k in range(n):
        v = R[k:, k].copy()
        v[0] += np.copysign(np.sqrt(v @ v), v[0])
        R[k:, k:] -= np.outer(v, (2 / (v @ v)) * (v @ R[k:, k:]))
    return np.triu(R[:n])


def inverse_of_triangle(R: Long) -> Long:
    out = np.eye(len(R), dtype=np.longdouble)
    for k in reversed(range(len(R))):
        out[k] = (out[k] - R[k, k + 1 :] @ out[k + 1 :]) / R[k, k]
    return out


def pseudo_inverse(J: Long, T: Long) -> Long:
    """(n, n) of J^T J, whose null space T (n, d) spans; J is not squared."""
    scale = 1 / np.sqrt(np.sum(J**2, axis=0))
    assert np.abs(J @ T).max() < 1e-13 * np.abs(J).max() * np.abs(T).max(), "T is not the null space of J"
    N = T / scale[:, None]
    N = N @ inverse_of_triangle(triangle(N))
    half = scale[:, None] * inverse_of_triangle(triangle(np.concatenate([J * scale, N.T])))
    Q = T @ inverse_of_triangle(triangle(T))
    half -= Q @ (Q.T @ half)
    N = scale[:, None] * N
    N -= Q @ (Q.T @ N)
    return half @ half.T - N @ N.T
