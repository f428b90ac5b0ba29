"""Whitened residuals of Eq. (1) and their analytic Jacobians in plain NumPy: what the kernels must compute.

Every rotation Jacobian is first taken with respect to a left increment in the world
frame, Eq. (8); ``first_rotation_chain`` turns the one of keyframe 0 into a Jacobian with
respect to the total increment of Eq. (9).
"""

from dataclasses import dataclass

import numpy as np

from vigauge.geometry import so3
from vigauge.geometry.camera import project
from vigauge.geometry.so3 import Array
from vigauge.model.problem import Problem
from vigauge.model.state import State


@dataclass(frozen=True)
class VisualTerm:
    """Whitened reprojection errors and Jacobians.

    ``residual`` (M, 2); ``by_pose`` (M, 2, 6) with respect to (position, rotation) of the
    observing keyframe; ``by_landmark`` (M, 2, 3).
    """

    residual: Array
    by_pose: Array
    by_landmark: Array


@dataclass(frozen=True)
class InertialTerm:
    """Whitened preintegration errors and Jacobians.

    ``residual`` (F, 9) in the order (position, rotation, velocity); ``by_first`` and
    ``by_second`` (F, 9, 9) with respect to (position, rotation, velocity) of the two keyframes.
    With biases (F, 15) and (F, 15, 15): then gyroscope, then accelerometer bias.
    """

    residual: Array
    by_first: Array
    by_second: Array


def first_rotation_chain(state: State) -> Array:
    """(3, 3) d(left increment of R_0) / d(dphi_0) = J_l(dphi_0), from Eq. (9)."""
    return so3.left_jacobian(state.dphi_0)


def _camera_points(problem: Problem, state: State) -> tuple[Array, Array, Array]:
    """Landmarks in the observing cameras (M, 3), R_CW (M, 3, 3), and X - p in W (M, 3)."""
    cameras = problem.camera_arrays
    # One rotation and centre a (camera, keyframe) pair, then gathered by observation.
    R_CW = cameras["R_BC"].swapaxes(1, 2)[:, None] @ state.R_WB.swapaxes(1, 2)[None]
    p_CB = -np.einsum("cji,cj->ci", cameras["R_BC"], cameras["p_BC"])
    R = R_CW[problem.obs_camera, problem.obs_keyframe]
    ray_W = state.X_W[problem.obs_landmark] - state.p_W[problem.obs_keyframe]
    return np.einsum("mij,mj->mi", R, ray_W) + p_CB[problem.obs_camera], R, ray_W


def _projected(problem: Problem, points_C: Array) -> tuple[Array, Array]:
    c, index = problem.camera_arrays, problem.obs_camera
    fx, fy, cx, cy = c["intrinsics"][index].T
    return project(points_C, fx, fy, cx, cy)


def visual_residual(problem: Problem, state: State) -> Array:
    """(M, 2) whitened r^V of Eq. (1): (predicted - measured) / sigma."""
    points_C, _, _ = _camera_points(problem, state)
    uv, _ = _projected(problem, points_C)
    return (uv - problem.obs_uv) / _sigmas(problem)


def _sigmas(problem: Problem) -> Array:
    """(M, 1) px, of each observation."""
    factor = np.ones(len(problem.obs_uv)) if problem.obs_noise is None else problem.obs_noise
    return problem.sigma_px * factor[:, None]


def visual_term(problem: Problem, state: State) -> VisualTerm:
    """r^V with Jacobians. With x_C = R_CW (X - p) + const and R <- Exp(d) R:
    dx_C/dX = R_CW, dx_C/dp = -R_CW, dx_C/dd = R_CW hat(X - p)."""
    points_C, R_CW, ray_W = _camera_points(problem, state)
    uv, by_point = _projected(problem, points_C)
    by_landmark = (by_point / _sigmas(problem)[:, :, None]) @ R_CW
    by_pose = np.empty((len(uv), 2, 6))
    np.negative(by_landmark, out=by_pose[:, :, :3])
    # a^T hat(b) = (a x b)^T, row by row.
    by_pose[:, :, 3:] = np.cross(by_landmark, ray_W[:, None, :])
    first = problem.obs_keyframe == 0
    by_pose[first, :, 3:] = by_pose[first, :, 3:] @ first_rotation_chain(state)
    return VisualTerm((uv - problem.obs_uv) / _sigmas(problem), by_pose, by_landmark)


def _at_biases(problem: Problem, state: State) -> tuple[Array, Array, Array, Array]:
    """dp, dR, dv at the biases of the state, and what their rotation was turned by."""
    f = problem.inertial
    if not problem.estimates_biases:
        return f.dp, f.dR, f.dv, np.zeros_like(f.dp)
    moved = np.einsum("fij,fj->fi", f.by_gyro_bias, state.gyro_bias[f.first] - f.gyro_bias)
    moved += np.einsum("fij,fj->fi", f.by_accel_bias, state.accel_bias[f.first] - f.accel_bias)
    return f.dp + moved[:, :3], f.dR @ so3.exp(moved[:, 3:6]), f.dv + moved[:, 6:], moved[:, 3:6]


def _inertial_predictions(problem: Problem, state: State) -> tuple[Array, Array, Array]:
    """Predicted (dp, dv) in the frame of the first keyframe, and the rotation error (F, 3)."""
    f = problem.inertial
    i, j, dt = f.first, f.second, f.dt[:, None]
    gravity_W = np.array([0.0, 0.0, -problem.gravity])
    shift_W = state.p_W[j] - state.p_W[i] - state.v_W[i] * dt - 0.5 * gravity_W * dt**2
    change_W = state.v_W[j] - state.v_W[i] - gravity_W * dt
    R_i = state.R_WB[i]
    shift = np.einsum("fji,fj->fi", R_i, shift_W)
    change = np.einsum("fji,fj->fi", R_i, change_W)
    rotation_error = so3.log(
        _at_biases(problem, state)[1].swapaxes(1, 2) @ R_i.swapaxes(1, 2) @ state.R_WB[j]
    )
    return shift, change, rotation_error


def _inertial_error(problem: Problem, state: State) -> Array:
    f = problem.inertial
    shift, change, rotation = _inertial_predictions(problem, state)
    dp, _, dv, _ = _at_biases(problem, state)
    steps = [b[f.second] - b[f.first] for b in (state.gyro_bias, state.accel_bias) if b is not None]
    return np.concatenate([shift - dp, rotation, change - dv, *steps], axis=1)


def inertial_residual(problem: Problem, state: State) -> Array:
    """(F, 9) whitened r^I of Eq. (1), order (position, rotation, velocity)."""
    error = _inertial_error(problem, state)
    return np.einsum("fij,fj->fi", problem.inertial.whitener, error)


def inertial_term(problem: Problem, state: State) -> InertialTerm:
    """r^I with Jacobians (Forster et al., the paper's [5], for left increments in W)."""
    f = problem.inertial
    shift, change, rotation = _inertial_predictions(problem, state)
    R_iT = state.R_WB[f.first].swapaxes(1, 2)
    R_jT = state.R_WB[f.second].swapaxes(1, 2)
    turn = so3.right_jacobian_inverse(rotation) @ R_jT
    dt = f.dt[:, None, None]
    first, second = np.zeros((2, len(f.dt), state.width, state.width))
    first[:, 0:3, 0:3] = -R_iT
    # R_i^T hat(a_W) = hat(R_i^T a_W) R_i^T
    first[:, 0:3, 3:6] = so3.hat(shift) @ R_iT
    first[:, 0:3, 6:9] = -R_iT * dt
    first[:, 3:6, 3:6] = -turn
    first[:, 6:9, 3:6] = so3.hat(change) @ R_iT
    first[:, 6:9, 6:9] = -R_iT
    second[:, 0:3, 0:3] = R_iT
    second[:, 3:6, 3:6] = turn
    second[:, 6:9, 6:9] = R_iT
    if problem.estimates_biases:
        by_bias = np.concatenate([f.by_gyro_bias, f.by_accel_bias], axis=2)
        moved = _at_biases(problem, state)[3]
        by_bias[:, 3:6] = so3.left_jacobian_inverse(rotation) @ so3.right_jacobian(moved) @ by_bias[:, 3:6]
        first[:, :9, 9:] = -by_bias
        first[:, 9:, 9:] = -np.eye(6)
        second[:, 9:, 9:] = np.eye(6)
    chain = first_rotation_chain(state)
    for block, keyframe in ((first, f.first), (second, f.second)):
        at_zero = keyframe == 0
        block[at_zero, :, 3:6] = block[at_zero, :, 3:6] @ chain
    return InertialTerm(
        residual=inertial_residual(problem, state), by_first=f.whitener @ first, by_second=f.whitener @ second
    )
