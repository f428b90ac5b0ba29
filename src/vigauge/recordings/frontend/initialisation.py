"""Visual-inertial alignment: velocities and the direction of gravity from poses and preintegrated factors.

Poses come in the frame M of the map, whose tilt is unknown. With them the equations of
motion over each interval are linear in the velocities and in gravity:

    p_j - p_i - R_i dp = v_i dt + g dt^2 / 2,      R_i dv = v_j - v_i - g dt.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import VigaugeError
from ...geometry import so3
from ...geometry.so3 import Array
from ...model.problem import InertialFactors

# How well PnP poses and the tilt of their rotations meet the equations: sets the weight of
# the position rows against the velocity rows only.
_POSITION_SIGMA_M = 0.01
_VELOCITY_SIGMA_MPS = 0.01
_REFINEMENTS = 5


@dataclass(frozen=True)
class GravityAlignment:
    """Result of :func:`align_with_gravity`."""

    # (3, 3) turns the map upright: its first body's roll and pitch are those that gravity tells, its yaw in W
    # is that of the least turn.
    R_WM: Array
    v_M: Array  # (N, 3) velocities in the map, m/s
    free_gravity: float  # length of gravity, m/s^2, where it is not forced to the known magnitude
    # Of what the equations leave over.
    rms_position_m: float
    rms_velocity_mps: float


def align_with_gravity(p_M: Array, R_MB: Array, factors: InertialFactors, gravity: float) -> GravityAlignment:
    """Velocities and gravity by linear least squares.

    Gravity is first solved for freely, then with its length held at ``gravity`` (m/s^2) and
    only its two angles moving.

    Parameters
    ----------
    p_M, R_MB : (N, 3) m and (N, 3, 3) body poses in the map

    Raises VigaugeError where the free solution is nowhere near gravity (poses, units, extrinsics or the sign
    convention are wrong).
    """
    A, b, sigma = _equations(p_M, R_MB, factors)
    free = np.linalg.lstsq(A / sigma[:, None], b / sigma, rcond=None)[0]
    g_M = free[-3:]
    length = length_of_gravity(g_M, gravity)
    g_M = g_M * (gravity / length)
    v_M = free[:-3]
    for _ in range(_REFINEMENTS):
        tangent = np.linalg.svd(g_M[None])[2][1:].T  # (3, 2) directions across gravity
        on_sphere = np.column_stack([A[:, :-3], A[:, -3:] @ tangent])
        solution = np.linalg.lstsq(on_sphere / sigma[:, None], (b - A[:, -3:] @ g_M) / sigma, rcond=None)[0]
        v_M = solution[:-2]
        g_M = g_M + tangent @ solution[-2:]
        g_M *= gravity / np.linalg.norm(g_M)
    left_over = (A[:, :-3] @ v_M + A[:, -3:] @ g_M - b).reshape(-1, 2, 3)
    rms = np.sqrt(np.mean(np.sum(left_over**2, axis=2), axis=0))
    return GravityAlignment(
        turn_onto(g_M, np.array([0.0, 0.0, -1.0])), v_M.reshape(-1, 3), length, *map(float, rms)
    )


def _equations(p_M: Array, R_MB: Array, factors: InertialFactors) -> tuple[Array, Array, Array]:
    """A (6F, 3N + 3), b (6F,) and the deviation of each row (6F,); unknowns: velocities, then gravity."""
    n, f = len(p_M), len(factors.dt)
    A, b = np.zeros((f, 2, 3, 3 * n + 3)), np.zeros((f, 2, 3))
    for k in range(f):
        i, j, dt = int(factors.first[k]), int(factors.second[k]), float(factors.dt[k])
        A[k, 0, :, 3 * i : 3 * i + 3] = dt * np.eye(3)
        A[k, 0, :, -3:] = 0.5 * dt**2 * np.eye(3)
        b[k, 0] = p_M[j] - p_M[i] - R_MB[i] @ factors.dp[k]
        A[k, 1, :, 3 * i : 3 * i + 3] = -np.eye(3)
        A[k, 1, :, 3 * j : 3 * j + 3] = np.eye(3)
        A[k, 1, :, -3:] = -dt * np.eye(3)
        b[k, 1] = R_MB[i] @ factors.dv[k]
    sigma = np.tile(np.repeat([_POSITION_SIGMA_M, _VELOCITY_SIGMA_MPS], 3), f)
    return A.reshape(6 * f, -1), b.ravel(), sigma


def length_of_gravity(g_M: Array, gravity: float) -> float:
    """Of a gravity that was solved for freely, m/s^2; VigaugeError where it is nowhere near ``gravity``."""
    length = float(np.linalg.norm(g_M))
    if not 0.5 * gravity < length < 1.5 * gravity:
        raise VigaugeError(
            f"visual-inertial alignment finds gravity of {length:.2f} m/s^2 instead of {gravity:.2f}: "
            "poses and inertial data do not belong together"
        )
    return length


def turn_onto(source: Array, target: Array) -> Array:
    """(3, 3) the rotation of least angle that turns ``source`` (3,) into the direction of ``target`` (3,)."""
    a, b = source / np.linalg.norm(source), target / np.linalg.norm(target)
    axis, cosine = np.cross(a, b), float(a @ b)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12:
        if cosine > 0.0:
            return np.eye(3)
        axis = np.cross(a, np.eye(3)[int(np.argmin(np.abs(a)))])
        return so3.exp(np.pi * axis / np.linalg.norm(axis))
    return so3.exp(np.arctan2(sine, cosine) / sine * axis)
