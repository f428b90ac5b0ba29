"""Covariances in any gauge, and the transformation between gauges (Section VI, Appendix A).

All of them are one family. Let G be any symmetric matrix with H G H = H. Then Q G Q^T,
with the oblique projector Q = I - U (V^T U)^-1 V^T of Eq. (14), is the covariance in the
gauge with normal V, whichever G was used. V = U gives the Moore-Penrose inverse, the free
gauge. G comes from the reduced camera system, whose null space is known in closed form
(15), so nothing is ever decomposed into singular values, and the cost grows linearly with
the number of landmarks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from . import so3
from .errors import DataError, DegenerateError
from .gauge import Gauge, GaugePrior, orbit_tangent
from .normal_equations import Index, NormalEquations, ReducedSystem, linearise
from .problem import Problem
from .so3 import Array
from .state import State


@dataclass(frozen=True)
class Spectrum:
    """Eigenvalues of the Jacobi-scaled reduced camera system, ascending, and what they say.

    Scaling makes metres, radians and near or far landmarks comparable; rank is that of H.
    """

    eigenvalues: Array
    n_landmarks: int

    @property
    def gap(self) -> float:
        """Fifth over fourth singular value from below: how clear the four null directions are."""
        magnitude = np.sort(np.abs(self.eigenvalues))
        return float(magnitude[4] / magnitude[3])

    @property
    def nullity(self) -> int:
        """Number of directions without information: zero to rounding, next to the largest."""
        magnitude = np.sort(np.abs(self.eigenvalues))
        null = magnitude < len(magnitude) * 1e3 * np.finfo(float).eps * magnitude[-1]
        return int(np.count_nonzero(null))

    @property
    def rank(self) -> int:
        """Rank of H: the landmark blocks that were eliminated have full rank."""
        return len(self.eigenvalues) - self.nullity + 3 * self.n_landmarks


def spectrum(equations: NormalEquations, held: Index | None = None) -> Spectrum:
    """Spectrum of the Schur complement of H after Jacobi scaling, without the ``held`` columns."""
    S = equations.eliminate().matrix
    if held is not None and len(held):
        keep = np.setdiff1d(np.arange(len(S)), held)
        S = S[np.ix_(keep, keep)]
    scale = 1.0 / np.sqrt(np.diagonal(S))
    return Spectrum(np.linalg.eigvalsh(S * scale[:, None] * scale), equations.structure.n_landmarks)


def _inverse(matrix: Array) -> Array:
    """Inverse of a positive definite matrix, scaled to a unit diagonal first.

    Raises DegenerateError where the matrix is singular to rounding: a factorisation may
    well succeed there, with pivots made of rounding errors.
    """
    n = len(matrix)
    scale = 1.0 / np.sqrt(np.diagonal(matrix))
    try:
        factor = np.linalg.cholesky(matrix * scale[:, None] * scale)
    except np.linalg.LinAlgError as error:
        raise DegenerateError("the information matrix is not positive definite in this gauge") from error
    half = scipy.linalg.solve_triangular(factor, np.eye(n), lower=True, check_finite=False)
    # The trace of the scaled inverse lies between one and n times 1 / (smallest eigenvalue).
    trace = float(np.vdot(half, half))
    if trace * 10 * n * np.finfo(float).eps > 1.0:
        raise DegenerateError(
            f"more is unobservable than the gauge: the scaled information is singular (below {n / trace:.0e})"
        )
    half *= scale
    return half.T @ half


def _inverse_on_complement(matrix: Array, null: Array) -> Array:
    """pinv(matrix) where ``null`` (n, 4) spans its null space: (A + s N N^T)^-1 - N N^T / s.

    s sits in the middle of the spectrum: far from either end it costs digits.
    """
    N, _ = np.linalg.qr(null)
    s = float(np.exp(np.mean(np.log(np.diagonal(matrix)))))
    return _inverse(matrix + s * (N @ N.T)) - N @ N.T / s


def motion_covariance(problem: Problem, state: State, gauge: Gauge) -> Array:
    """(9N, 9N) covariance of the motion parameters in a gauge (m, rad, m/s).

    Fixed gauge: inverse of the reduced Hessian, zero rows where held. Prior: inverse with
    the prior added. Any other gauge, the free one included: projection by its normal.

    Raises DegenerateError where more than the gauge is unobservable.
    """
    return covariance_of(linearise(problem, state), state, gauge, problem.initial)


def covariance_of(equations: NormalEquations, state: State, gauge: Gauge, reference: State) -> Array:
    """As :func:`motion_covariance`, from normal equations at hand."""
    prior = gauge.prior(state, reference)
    reduced = equations.eliminate()
    if prior is not None:
        return _with_prior(reduced, state, prior)
    held = gauge.held(state)
    if len(held):
        return _inverse_without(reduced.matrix, held)
    return _projected(reduced, state, gauge.normal(state))


def _inverse_without(matrix: Array, held: Index) -> Array:
    keep = np.setdiff1d(np.arange(len(matrix)), held)
    covariance = np.zeros_like(matrix)
    covariance[np.ix_(keep, keep)] = _inverse(matrix[np.ix_(keep, keep)])
    return covariance


def _with_prior(reduced: ReducedSystem, state: State, prior: GaugePrior) -> Array:
    """Motion block of (H + V V^T)^-1, where V^T is the whitened Jacobian of the prior.

    A prior on four gauge parameters says nothing about the shape, so this is the covariance
    in the gauge with normal V plus the freedom that the prior leaves along the orbit:
    U M M^T U^T with M = (V^T U)^-1. It stays exact at any weight, where H + V V^T does not.
    """
    V = np.zeros((state.n_parameters, len(prior.residual)))
    V[prior.columns] = prior.jacobian.T
    U = orbit_tangent(state)
    try:
        along = np.linalg.solve((V.T @ U).T, U[: len(reduced.matrix)].T)
    except np.linalg.LinAlgError as error:
        raise DegenerateError("the prior leaves part of the gauge free") from error
    return _projected(reduced, state, V) + along.T @ along


def _projected(reduced: ReducedSystem, state: State, V: Array) -> Array:
    """Motion block of Q G Q^T, with G built on the inverse of S off its null space.

    With M = (V^T U)^-1 this is G - U M (V^T G) - (G V) M^T U^T + U M (V^T G V) M^T U^T: the
    landmarks enter through four columns only.
    """
    n_motion = len(reduced.matrix)
    U = orbit_tangent(state)
    U_motion, V_motion = U[:n_motion], V[:n_motion]
    V_landmark = V[n_motion:].reshape(-1, 3, 4)
    G = _inverse_on_complement(reduced.matrix, U_motion)
    half_V = reduced.factor @ V_landmark  # F V_l, with F^T F = C^-1
    through = V_motion - reduced.couple_back(half_V)
    G_V = G @ through
    V_G_V = through.T @ G_V + np.einsum("kij,kil->jl", half_V, half_V)
    return _low_rank_projection(G, G_V, V_G_V, U_motion, V.T @ U)


def _low_rank_projection(G: Array, G_V: Array, V_G_V: Array, U: Array, V_T_U: Array) -> Array:
    """Q G Q^T from G, G V and V^T G V: a rank-8 update."""
    W = np.linalg.solve(V_T_U.T, U.T).T  # U M
    cross = (G_V - 0.5 * W @ V_G_V) @ W.T
    out = G - cross - cross.T
    return 0.5 * (out + out.T)


def project_covariance(covariance: Array, U: Array, V: Array) -> Array:
    """Q cov Q^T of Eqs. (12), (14) at one linearisation point, without forming Q.

    Parameters
    ----------
    covariance : (n, n) in any gauge
    U : (n, 4) basis of the null space of H (the orbit's tangent)
    V : (n, 4) normal of the gauge wanted
    """
    covariance_V = covariance @ V
    return _low_rank_projection(covariance, covariance_V, V.T @ covariance_V, U, V.T @ U)


def covariance_from_hessian(H: Array, U: Array, V: Array | None = None) -> Array:
    """Covariance in the gauge with normal V from any estimator's singular Hessian.

    Parameters
    ----------
    H : (n, n) information matrix with null space spanned by U
    U : (n, d) null directions (4 for visual-inertial, 7 for monocular problems)
    V : (n, d) constraint normals of the gauge; None for the pseudo-inverse (V = U)

    Raises
    ------
    DataError
        where U is not in the null space of H
    DegenerateError
        where H has further null directions
    """
    scale = np.sqrt(np.diagonal(H))
    if not np.all(scale > 0):
        raise DataError(
            "H", "diagonal must be positive", row=int(np.argmin(scale)), value=float(scale.min()) ** 2
        )
    leak = np.linalg.norm((H @ U) / scale[:, None], axis=0) / np.linalg.norm(scale[:, None] * U, axis=0)
    if np.max(leak) > 1e-6:
        raise DataError(
            "U", "columns must be in the null space of H", row=int(np.argmax(leak)), value=float(leak.max())
        )
    G = _inverse_on_complement(H, U)
    return project_covariance(G, U, U if V is None else V)


def transfer_blocks(state: State, moved: State, yaw: float, count: int) -> Array:
    """(count, 3, 3) diagonal blocks of d(theta_C)/d(theta) (Appendix A)."""
    blocks = np.broadcast_to(so3.yaw_rotation(yaw), (count, 3, 3)).copy()
    blocks[state.n_keyframes] = so3.right_jacobian_inverse(moved.dphi_0) @ so3.right_jacobian(state.dphi_0)
    return blocks


def transform_covariance(
    covariance: Array, state: State, gauge: Gauge, reference: State
) -> tuple[Array, State]:
    """Eq. (12): a covariance at ``state`` taken to a gauge.

    Parameters
    ----------
    covariance : (9N, 9N) motion block, or (9N + 3K, 9N + 3K) with landmarks; usually the free one
    state : estimate it belongs to
    gauge : gauge wanted
    reference : state whose first pose the gauge keeps (the initial state of the problem)

    Returns
    -------
    covariance in the gauge, same shape, and theta_C, the estimate moved onto the gauge

    Raises
    ------
    DataError
        for another shape, or a motion block where the gauge constrains landmarks
    """
    n = len(covariance)
    n_motion = 9 * state.n_keyframes
    if covariance.shape not in ((n_motion, n_motion), (state.n_parameters,) * 2):
        raise DataError(
            "covariance",
            f"shape must be ({n_motion}, {n_motion}) or {(state.n_parameters,) * 2}",
            value=covariance.shape,
        )
    moved, yaw = gauge.meet(state, reference)
    V = gauge.normal(moved)
    if n == n_motion and np.any(V[n_motion:]):
        raise DataError(
            "covariance", f"gauge '{gauge.name}' constrains landmarks, so their covariance is needed"
        )
    blocks = transfer_blocks(state, moved, yaw, n // 3)
    carried = (blocks @ covariance.reshape(n // 3, 3, n)).reshape(n, n)
    carried = (blocks @ carried.T.reshape(n // 3, 3, n)).reshape(n, n)
    return project_covariance(carried, orbit_tangent(moved)[:n], V[:n]), moved
