"""Whitened residuals of Eq. (1) at a state, over all measurements.

Their Jacobians are never stored: :mod:`vigauge.solver.normal_equations` sums them into blocks.
Rotation derivatives are with respect to left increments in the world frame, Eq. (8).
"""

from __future__ import annotations

from types import ModuleType
from typing import NamedTuple

import numpy as np

from ..geometry.so3 import Array
from ..kernels import inertial, inertial_biases
from ..kernels import visual as visual_kernels
from ..model.problem import Problem
from ..model.state import State


def camera_rotations(problem: Problem, state: State) -> Array:
    """R_CW (C, N, 3, 3) of every camera at every keyframe."""
    problem.initial.require_size(state)
    R_CW = np.empty((len(problem.cameras), state.n_keyframes, 3, 3))
    visual_kernels.camera_rotations(state.R_WB, problem.camera_arrays["R_BC"], R_CW)
    return R_CW


def inertial_kernels(problem: Problem) -> ModuleType:
    """``residuals``, ``cost`` and ``accumulate`` of inertial factors, with or without biases."""
    return inertial_biases if problem.estimates_biases else inertial


def inertial_inputs(problem: Problem, state: State) -> tuple[Array | float, ...]:
    """What :func:`inertial_kernels` read, of a state that has the problem's size."""
    motion = *problem.increments, state.p_W, state.R_WB, state.v_W
    if state.gyro_bias is None or state.accel_bias is None:
        return motion
    return *motion, state.gyro_bias, state.accel_bias


class Evaluation(NamedTuple):
    """The ``cost`` of a state, 1/2 ||r||^2 (reprojection errors through their loss, if there is one), and the
    mean length of a reprojection error in pixels (Fig. 6).

    ``R_CW`` as :func:`camera_rotations` gives it: the normal equations of the state need it again.
    """

    cost: float
    mean_reprojection_px: float
    R_CW: Array


def evaluate(problem: Problem, state: State) -> Evaluation:
    """The cost of Eq. (1), no residual kept, of a state that has the problem's size.

    It is not finite where a landmark has depth zero.
    """
    cameras = problem.camera_arrays
    R_CW = np.empty((len(problem.cameras), state.n_keyframes, 3, 3))
    squares, lengths = visual_kernels.cost(
        state.p_W,
        state.R_WB,
        state.X_W,
        cameras["R_BC"],
        cameras["p_CB"],
        cameras["intrinsics"],
        problem.pixels,
        *problem.compiled_loss,
        R_CW,
        *problem.structure.batches,
    )
    squares += inertial_kernels(problem).cost(*inertial_inputs(problem, state))
    for factor in problem.factors:
        residual = factor.at(state, problem.initial).residual
        squares += float(residual @ residual)
    count = len(problem.obs_uv)
    return Evaluation(0.5 * squares, lengths * problem.sigma_px / count if count else 0.0, R_CW)


def visual_residual(problem: Problem, state: State) -> Array:
    """(M, 2) whitened r^V of Eq. (1): (predicted - measured) / sigma."""
    out = np.empty(problem.obs_uv.shape)
    cameras = problem.camera_arrays
    visual_kernels.residuals(
        state.p_W,
        state.X_W,
        camera_rotations(problem, state),
        cameras["p_CB"],
        cameras["intrinsics"],
        problem.obs_keyframe,
        problem.obs_camera,
        problem.obs_landmark,
        problem.obs_uv,
        problem.obs_weight,
        out,
    )
    return out


def inertial_residual(problem: Problem, state: State) -> Array:
    """(F, 9) whitened r^I of Eq. (1), order (position, rotation, velocity).

    With biases (F, 15): then the steps of the gyroscope's and the accelerometer's bias.
    """
    problem.initial.require_size(state)
    out = np.empty((len(problem.inertial.dt), problem.initial.width))
    inertial_kernels(problem).residuals(out, *inertial_inputs(problem, state))
    return out


def cost(problem: Problem, state: State) -> float:
    """1/2 ||r||^2 over visual (through their loss) and inertial residuals: half of J(theta) of Eq. (1)."""
    problem.initial.require_size(state)
    return evaluate(problem, state).cost


def down_weighted(problem: Problem, state: State) -> int:
    """How many reprojection errors are longer than ``delta`` of the problem's loss; 0 without one."""
    if problem.loss is None:
        return 0
    return int(np.sum(np.linalg.norm(visual_residual(problem, state), axis=1) > problem.loss.delta))


def mean_reprojection_px(problem: Problem, state: State) -> float:
    """Mean length of the reprojection error over all observations, pixels (Fig. 6); 0 without any."""
    problem.initial.require_size(state)
    return evaluate(problem, state).mean_reprojection_px
