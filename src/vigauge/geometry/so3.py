"""The rotation group SO(3), batched: every function takes leading axes of any shape.

Rotation vectors are in radians. ``Exp`` and ``Log`` follow the paper (Section II-A);
the Jacobians are those of Chirikjian (the paper's [22], p. 40):

    Exp(phi + d) = Exp(J_l(phi) d) Exp(phi) = Exp(phi) Exp(J_r(phi) d)   to first order.

Coefficients that cancel near zero are replaced there by their power series. The
threshold is where both forms keep 14 digits, so nothing jumps at it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

# Below this angle (rad) the closed forms lose digits to cancellation: at 0.3 they are
# still good to 1e-14, and the series, cut after five or six terms, to 3e-15.
SERIES_ANGLE = 0.3


def hat(phi: Array) -> Array:
    """Cross-product matrix: ``hat(a) @ b == cross(a, b)``. Shape (..., 3) to (..., 3, 3)."""
    phi = np.asarray(phi, dtype=float)
    out = np.zeros(phi.shape[:-1] + (3, 3))
    out[..., 0, 1] = -phi[..., 2]
    out[..., 0, 2] = phi[..., 1]
    out[..., 1, 0] = phi[..., 2]
    out[..., 1, 2] = -phi[..., 0]
    out[..., 2, 0] = -phi[..., 1]
    out[..., 2, 1] = phi[..., 0]
    return out


def _angle_squared(phi: Array) -> Array:
    return np.einsum("...i,...i->...", phi, phi)


def _polynomial(linear: Array, quadratic: Array, phi: Array, squared: Array) -> Array:
    """I + linear * hat(phi) + quadratic * hat(phi)^2, with hat^2 = phi phi^T - |phi|^2 I."""
    out = linear[..., None, None] * hat(phi)
    out += quadratic[..., None, None] * (phi[..., :, None] * phi[..., None, :])
    diagonal = 1.0 - quadratic * squared
    for axis in range(3):
        out[..., axis, axis] += diagonal
    return out


def exp(phi: Array) -> Array:
    """Rotation matrix of a rotation vector (Rodrigues). Shape (..., 3) to (..., 3, 3)."""
    phi = np.asarray(phi, dtype=float)
    squared = _angle_squared(phi)
    angle = np.sqrt(squared)
    return _polynomial(np.sinc(angle / np.pi), 0.5 * np.sinc(0.5 * angle / np.pi) ** 2, phi, squared)


def quaternion(R: Array) -> Array:
    """Unit quaternion (w, x, y, z), w >= 0, of a rotation matrix. Shape (..., 3, 3) to (..., 4).

    The largest of the four components is taken from the diagonal and the others from
    it (Shepperd's method), so no angle, pi included, loses digits.
    """
    R = np.asarray(R, dtype=float)
    xx, yy, zz = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    # Row k holds 4 q_k q, the k-th column of the symmetric matrix 4 q q^T.
    candidates = np.empty(R.shape[:-2] + (4, 4))
    candidates[..., 0, 0] = 1.0 + xx + yy + zz
    candidates[..., 1, 1] = 1.0 + xx - yy - zz
    candidates[..., 2, 2] = 1.0 - xx + yy - zz
    candidates[..., 3, 3] = 1.0 - xx - yy + zz
    for row, column, value in (
        (0, 1, R[..., 2, 1] - R[..., 1, 2]),
        (0, 2, R[..., 0, 2] - R[..., 2, 0]),
        (0, 3, R[..., 1, 0] - R[..., 0, 1]),
        (1, 2, R[..., 1, 0] + R[..., 0, 1]),
        (1, 3, R[..., 0, 2] + R[..., 2, 0]),
        (2, 3, R[..., 2, 1] + R[..., 1, 2]),
    ):
        candidates[..., row, column] = candidates[..., column, row] = value
    largest = np.argmax(np.diagonal(candidates, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(candidates, largest[..., None, None], axis=-2)[..., 0, :]
    q = q / np.sqrt(np.einsum("...i,...i->...", q, q))[..., None]
    return np.where(q[..., :1] < 0.0, -q, q)


def from_quaternion(q: Array) -> Array:
    """Rotation matrix of a unit quaternion (w, x, y, z). Shape (..., 4) to (..., 3, 3)."""
    q = np.asarray(q, dtype=float)
    w, vector = q[..., 0], q[..., 1:]
    two_cross = 2.0 * hat(vector)
    return np.eye(3) + w[..., None, None] * two_cross + 0.5 * two_cross @ two_cross


def log(R: Array) -> Array:
    """Rotation vector of length at most pi of a rotation matrix. Shape (..., 3, 3) to (..., 3)."""
    q = quaternion(R)
    vector = q[..., 1:]
    sine = np.sqrt(_angle_squared(vector))
    half_angle = np.arctan2(sine, q[..., 0])
    # vector = sin(half) axis, so the factor is angle / sin(half) = 2 / sinc(half).
    return (2.0 / np.sinc(half_angle / np.pi))[..., None] * vector


def _cubic_coefficient(squared: Array) -> Array:
    """(t - sin t) / t^3."""
    near = 1 / 6 + squared * (
        -1 / 120 + squared * (1 / 5040 + squared * (-1 / 362880 + squared * (1 / 39916800)))
    )
    angle = np.sqrt(np.maximum(squared, SERIES_ANGLE**2))
    far = (angle - np.sin(angle)) / angle**3
    return np.where(squared < SERIES_ANGLE**2, near, far)


def _inverse_coefficient(squared: Array) -> Array:
    """(1 - (t/2) cot(t/2)) / t^2."""
    near = 1 / 12 + squared * (
        1 / 720
        + squared
        * (1 / 30240 + squared * (1 / 1209600 + squared * (1 / 47900160 + squared * (691 / 1307674368000))))
    )
    half = 0.5 * np.sqrt(np.maximum(squared, SERIES_ANGLE**2))
    far = (1.0 - half / np.tan(half)) / (4.0 * half**2)
    return np.where(squared < SERIES_ANGLE**2, near, far)


def left_jacobian(phi: Array) -> Array:
    """J_l(phi): Exp(phi + d) = Exp(J_l d) Exp(phi). Shape (..., 3) to (..., 3, 3)."""
    phi = np.asarray(phi, dtype=float)
    squared = _angle_squared(phi)
    half = 0.5 * np.sqrt(squared)
    return _polynomial(0.5 * np.sinc(half / np.pi) ** 2, _cubic_coefficient(squared), phi, squared)


def left_jacobian_inverse(phi: Array) -> Array:
    """J_l(phi)^-1; singular at |phi| = 2 pi only. Shape (..., 3) to (..., 3, 3)."""
    phi = np.asarray(phi, dtype=float)
    squared = _angle_squared(phi)
    return _polynomial(np.full(squared.shape, -0.5), _inverse_coefficient(squared), phi, squared)


def right_jacobian(phi: Array) -> Array:
    """J_r(phi) = J_l(-phi): Exp(phi + d) = Exp(phi) Exp(J_r d)."""
    return left_jacobian(-np.asarray(phi, dtype=float))


def right_jacobian_inverse(phi: Array) -> Array:
    """J_r(phi)^-1 = J_l(-phi)^-1."""
    return left_jacobian_inverse(-np.asarray(phi, dtype=float))


def yaw_rotation(alpha: float) -> Array:
    """R_z = Exp(alpha e_z) of the gauge group, Eq. (4)."""
    return exp(np.array([0.0, 0.0, alpha]))
