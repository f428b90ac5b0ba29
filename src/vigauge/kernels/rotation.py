"""Scalar forms of :mod:`vigauge.geometry.so3`, for use inside kernels; matrices are filled in place."""

from __future__ import annotations

import math

import numpy as np

from ..geometry.so3 import SERIES_ANGLE, Array
from .compiled import kernel, part

SERIES_SQUARED = SERIES_ANGLE**2


@part
def _polynomial(linear: float, quadratic: float, phi: Array, sign: float, out: Array) -> None:
    """out = I + linear * hat(sign phi) + quadratic * hat(phi)^2."""
    x, y, z = phi[0], phi[1], phi[2]
    s = linear * sign
    out[0, 0] = 1.0 - quadratic * (y * y + z * z)
    out[1, 1] = 1.0 - quadratic * (x * x + z * z)
    out[2, 2] = 1.0 - quadratic * (x * x + y * y)
    out[0, 1] = quadratic * x * y - s * z
    out[1, 0] = quadratic * x * y + s * z
    out[0, 2] = quadratic * x * z + s * y
    out[2, 0] = quadratic * x * z - s * y
    out[1, 2] = quadratic * y * z - s * x
    out[2, 1] = quadratic * y * z + s * x


@part
def exp(phi: Array, out: Array) -> None:
    """Rotation matrix of a rotation vector."""
    squared = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]
    angle = math.sqrt(squared)
    linear, half = 1.0, 1.0
    if angle > 0.0:
        linear = math.sin(angle) / angle
        half = math.sin(0.5 * angle) / (0.5 * angle)
    _polynomial(linear, 0.5 * half * half, phi, 1.0, out)


@part
def left_jacobian(phi: Array, out: Array) -> None:
    """J_l(phi): Exp(phi + d) = Exp(J_l d) Exp(phi)."""
    t = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]
    angle = math.sqrt(t)
    half = 1.0
    if angle > 0.0:
        half = math.sin(0.5 * angle) / (0.5 * angle)
    if t < SERIES_SQUARED:
        cubic = 1 / 6 + t * (-1 / 120 + t * (1 / 5040 + t * (-1 / 362880 + t * (1 / 39916800))))
    else:
        cubic = (angle - math.sin(angle)) / (angle * t)
    _polynomial(0.5 * half * half, cubic, phi, 1.0, out)


@part
def right_jacobian_inverse(phi: Array, out: Array) -> None:
    """J_r(phi)^-1 = J_l(-phi)^-1."""
    t = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]
    if t < SERIES_SQUARED:
        coefficient = 1 / 12 + t * (
            1 / 720 + t * (1 / 30240 + t * (1 / 1209600 + t * (1 / 47900160 + t * (691 / 1307674368000))))
        )
    else:
        half = 0.5 * math.sqrt(t)
        coefficient = (1.0 - half / math.tan(half)) / t
    _polynomial(-0.5, coefficient, phi, -1.0, out)


@part
def log(R: Array, out: Array) -> None:
    """Rotation vector of length at most pi of a rotation matrix (Shepperd's quaternion)."""
    xx, yy, zz = R[0, 0], R[1, 1], R[2, 2]
    w2 = 1.0 + xx + yy + zz
    x2 = 1.0 + xx - yy - zz
    y2 = 1.0 - xx + yy - zz
    z2 = 1.0 - xx - yy + zz
    if w2 >= x2 and w2 >= y2 and w2 >= z2:
        w, x, y, z = w2, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    elif x2 >= y2 and x2 >= z2:
        w, x, y, z = R[2, 1] - R[1, 2], x2, R[1, 0] + R[0, 1], R[0, 2] + R[2, 0]
    elif y2 >= z2:
        w, x, y, z = R[0, 2] - R[2, 0], R[1, 0] + R[0, 1], y2, R[2, 1] + R[1, 2]
    else:
        w, x, y, z = R[1, 0] - R[0, 1], R[0, 2] + R[2, 0], R[2, 1] + R[1, 2], z2
    length = math.sqrt(w * w + x * x + y * y + z * z)
    if w < 0.0:
        length = -length
    w, x, y, z = w / length, x / length, y / length, z / length
    sine = math.sqrt(x * x + y * y + z * z)
    half_angle = math.atan2(sine, w)
    factor = 2.0
    if half_angle > 0.0:
        factor = 2.0 * half_angle / math.sin(half_angle)
    out[0], out[1], out[2] = factor * x, factor * y, factor * z


@kernel
def retract(
    delta: Array,
    p_W: Array,
    R_WB: Array,
    v_W: Array,
    X_W: Array,
    dphi_0: Array,
    R_ref: Array,
    p_out: Array,
    R_out: Array,
    v_out: Array,
    X_out: Array,
    dphi_out: Array,
) -> None:
    """Eqs. (8)-(9): Exp(step) R for all but the first, Exp(dphi_0) R_ref for the first; the rest is added.

    ``delta`` (n,) in the package's order: by kind, the motion first, and landmarks last.
    """
    n, turn = len(p_W), np.empty((3, 3))
    landmarks = len(delta) - 3 * len(X_W)
    for a in range(3):
        dphi_out[a] = dphi_0[a] + delta[3 * n + a]
    for i in range(n):
        if i == 0:
            exp(dphi_out, turn)
            base = R_ref
        else:
            exp(delta[3 * (n + i) : 3 * (n + i) + 3], turn)
            base = R_WB[i]
        for a in range(3):
            p_out[i, a] = p_W[i, a] + delta[3 * i + a]
            v_out[i, a] = v_W[i, a] + delta[3 * (2 * n + i) + a]
            for b in range(3):
                R_out[i, a, b] = turn[a, 0] * base[0, b] + turn[a, 1] * base[1, b] + turn[a, 2] * base[2, b]
    for j in range(len(X_W)):
        for a in range(3):
            X_out[j, a] = X_W[j, a] + delta[landmarks + 3 * j + a]


@part
def _drift(R: Array) -> float:
    """Sum of the sizes of R R^T - I; large for a mirror image, NaN where R has one."""
    out = 0.0
    for a in range(3):
        for b in range(a, 3):
            product = R[a, 0] * R[b, 0] + R[a, 1] * R[b, 1] + R[a, 2] * R[b, 2]
            out += abs(product - (1.0 if a == b else 0.0))
    determinant = (
        R[0, 0] * (R[1, 1] * R[2, 2] - R[1, 2] * R[2, 1])
        - R[0, 1] * (R[1, 0] * R[2, 2] - R[1, 2] * R[2, 0])
        + R[0, 2] * (R[1, 0] * R[2, 1] - R[1, 1] * R[2, 0])
    )
    return out + (0.0 if determinant > 0.0 else 2.0)


@kernel
def state_defect(p_W: Array, R_WB: Array, v_W: Array, X_W: Array, dphi_0: Array, R_ref: Array) -> float:
    """Zero or tiny for a valid state: finite numbers, rotations, Eq. (9) true of the first; NaN is not.

    A quick look, no measure: a state with more than 1e-6 is looked at again, part by part.
    """
    out = 0.0
    for vectors in (p_W, v_W, X_W):
        for i in range(len(vectors)):
            for a in range(3):
                out += 0.0 * vectors[i, a]  # NaN for infinity too
    for i in range(len(R_WB)):
        out += _drift(R_WB[i])
    out += _drift(R_ref)
    squared = dphi_0[0] * dphi_0[0] + dphi_0[1] * dphi_0[1] + dphi_0[2] * dphi_0[2]
    if not math.sqrt(squared) < 2.0 * math.pi - 1e-6:
        return 1.0
    turn = np.empty((3, 3))
    exp(dphi_0, turn)
    for a in range(3):
        for b in range(3):
            product = turn[a, 0] * R_ref[0, b] + turn[a, 1] * R_ref[1, b] + turn[a, 2] * R_ref[2, b]
            out += abs(product - R_WB[0, a, b])
    return out


@kernel
def orbit_tangent(p_W: Array, v_W: Array, X_W: Array, dphi_0: Array, U: Array) -> None:
    """Eq. (15) into ``U`` (n, 4): columns (yaw, x, y, z), rows as in :mod:`vigauge.model.state`."""
    n, landmarks = len(p_W), len(U) - 3 * len(X_W)
    U[:] = 0.0
    for vectors, start in ((p_W, 0), (v_W, 6 * n), (X_W, landmarks)):
        for i in range(len(vectors)):
            # e_z x a = (-a_y, a_x, 0)
            U[start + 3 * i, 0], U[start + 3 * i + 1, 0] = -vectors[i, 1], vectors[i, 0]
    for i in range(n + len(X_W)):
        row = 3 * i if i < n else landmarks + 3 * (i - n)
        for a in range(3):
            U[row + a, 1 + a] = 1.0
    for i in range(n):
        U[3 * n + 3 * i + 2, 0] = 1.0
    inverse = np.empty((3, 3))
    right_jacobian_inverse(-dphi_0, inverse)  # J_r(-phi) = J_l(phi)
    for a in range(3):
        U[3 * n + a, 0] = inverse[a, 2]


@part
def first_pose_error(p_W: Array, p_ref: Array, dphi_0: Array, whitener: Array, out: Array) -> None:
    """Whitened residual of Eq. (11) into ``out`` (4,): first position, then the z part of dphi_0."""
    for a in range(3):
        out[a] = whitener[a, a] * (p_W[0, a] - p_ref[0, a])
    out[3] = whitener[3, 3] * dphi_0[2]
