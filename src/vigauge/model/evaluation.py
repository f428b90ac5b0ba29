"""Errors of an estimate against the truth (Section IV-C), and comparisons of covariances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import instance, reals, shape_of
from ..errors import DataError, VigaugeError
from ..geometry import so3
from ..geometry.so3 import Array
from .state import State


@dataclass(frozen=True)
class TrajectoryErrors:
    """RMSE over all keyframes: position (m), rotation (rad), velocity (m/s)."""

    p_rmse_m: float
    phi_rmse_rad: float
    v_rmse_mps: float

    @property
    def phi_rmse_deg(self) -> float:
        return float(np.degrees(self.phi_rmse_rad))


def align_first_pose(estimate: State, truth: State) -> State:
    """``estimate`` moved by the 4-DoF transformation that joins the first poses (Section IV-C.1).

    The yaw is the twist about z of R_truth R_estimate^T. Raises VigaugeError where that is a turn
    by pi about a level axis, which has no twist.
    """
    q = so3.quaternion(truth.R_WB[0] @ estimate.R_WB[0].T)
    if np.hypot(q[0], q[3]) < 1e-9:
        raise VigaugeError(
            "yaw between estimate and truth is undefined: they differ by pi about a level axis"
        )
    yaw = 2.0 * float(np.arctan2(q[3], q[0]))
    return estimate.transformed(yaw, truth.p_W[0] - so3.yaw_rotation(yaw) @ estimate.p_W[0])


def align_all_poses(estimate: State, truth: State) -> State:
    """``estimate`` moved by the 4-DoF transformation that brings all positions closest together.

    Closed form: the shift joins the centroids, the yaw is the least-squares one in the
    horizontal plane. Unlike the first-pose alignment of the paper, an error of the first
    true pose does not enter every other error.
    """
    a = estimate.p_W - estimate.p_W.mean(axis=0)
    b = truth.p_W - truth.p_W.mean(axis=0)
    cross = float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
    yaw = float(np.arctan2(cross, np.sum(a[:, :2] * b[:, :2])))
    shift = truth.p_W.mean(axis=0) - so3.yaw_rotation(yaw) @ estimate.p_W.mean(axis=0)
    return estimate.transformed(yaw, shift)


def trajectory_errors(
    estimate: State, truth: State, align: Callable[[State, State], State] = align_first_pose
) -> TrajectoryErrors:
    """RMSE over the keyframes of both states after alignment, the paper's by default (Section IV-C.1)."""
    instance("estimate", estimate, State).require_bounded()
    instance("truth", truth, State).require_bounded()
    if estimate.n_keyframes != truth.n_keyframes:
        raise VigaugeError(
            "estimate and truth must have the same keyframes: "
            f"{estimate.n_keyframes} against {truth.n_keyframes}"
        )
    aligned = align(estimate, truth)
    rotation = so3.log(aligned.R_WB @ truth.R_WB.swapaxes(1, 2))
    return TrajectoryErrors(
        p_rmse_m=_rms_length(aligned.p_W - truth.p_W),
        phi_rmse_rad=_rms_length(rotation),
        v_rmse_mps=_rms_length(aligned.v_W - truth.v_W),
    )


def _rms_length(errors: Array) -> float:
    return float(np.sqrt(np.mean(np.einsum("ij,ij->i", errors, errors))))


@dataclass(frozen=True)
class CovarianceDefects:
    """What a covariance must not have: both near the rounding error where all is well.

    ``asymmetry`` ||A - A^T|| / ||A||; ``negativity`` size of the most negative eigenvalue of the
    symmetric part with unit diagonal, next to the largest (0 if none is negative).
    """

    asymmetry: float
    negativity: float


def covariance_defects(covariance: Array) -> CovarianceDefects:
    """How far a matrix is from symmetric and from positive semi-definite, whatever its units."""
    covariance = reals("covariance", covariance, ("n", "n"))
    norm = float(np.linalg.norm(covariance))
    diagonal = np.diagonal(covariance)
    if norm == 0.0 or np.any(diagonal < 0.0):
        return CovarianceDefects(0.0, 0.0 if norm == 0.0 else 1.0)
    # Parameters that are held have zero rows.
    moving = diagonal > 1e-15 * diagonal.max()
    scale = 1.0 / np.sqrt(diagonal[moving])
    scaled = covariance[np.ix_(moving, moving)] * scale[:, None] * scale
    values = np.linalg.eigvalsh(0.5 * (scaled + scaled.T))
    return CovarianceDefects(
        asymmetry=float(np.linalg.norm(covariance - covariance.T)) / norm,
        negativity=max(0.0, -float(values[0] / values[-1])),
    )


def relative_frobenius(A: Array, reference: Array) -> float:
    """||A - reference||_F / ||reference||_F (captions of Figs. 9 and 10).

    Raises DataError for matrices of different shapes, numbers that are not finite, and a reference of zeros.
    """
    reference = reals("reference", reference, shape_of("reference", reference))
    A = reals("A", A, reference.shape)
    size = float(np.linalg.norm(reference))
    if not size > 0.0:
        raise DataError("reference", "must not be zero", value=reference.shape)
    return float(np.linalg.norm(A - reference)) / size
