"""Covariances in any gauge, and the transformation between gauges (Section VI, Appendix A).

All of them are one family. Let G be any symmetric matrix with H G H = H. Then Q G Q^T,
with the oblique projector Q = I - U (V^T U)^-1 V^T of Eq. (14), is the covariance in the
gauge with normal V, whichever G was used. V = U gives the Moore-Penrose inverse, the free
gauge. G is the inverse of the reduced camera system with the first position and yaw held, and the
null space is known in closed form (15), so nothing is ever decomposed into singular values, and
the cost grows linearly with the number of landmarks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.linalg.lapack as lapack

from ..errors import DataError, DegenerateError
from ..gauge.gauges import FreeGauge, Gauge, GaugePrior, first_pose_columns, orbit_tangent
from ..geometry import so3
from ..geometry.so3 import Array
from ..kernels import symmetric
from ..model.problem import Problem
from ..model.state import State
from ..observability.conditioning import scaled_eigenvalues
from ..solver.normal_equations import NormalEquations, ReducedSystem, linearise
from ..sparsity.layout import Index
from .held_inverse import HeldInverse, require_regular


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
    return Spectrum(scaled_eigenvalues(S), equations.structure.n_landmarks)


def _inverse(matrix: Array) -> Array:
    """Inverse of a positive definite matrix, scaled to a unit diagonal first.

    Raises DegenerateError where the matrix is singular to rounding.
    """
    n = len(matrix)
    scale = 1.0 / np.sqrt(np.diagonal(matrix))
    try:
        factor = np.linalg.cholesky(matrix * scale[:, None] * scale)
    except np.linalg.LinAlgError as error:
        raise DegenerateError("the information matrix is not positive definite in this gauge") from error
    half = scipy.linalg.solve_triangular(factor, np.eye(n), lower=True, check_finite=False)
    require_regular(float(np.vdot(half, half)), n)
    half *= scale
    return half.T @ half


def _inverse_on_complement(matrix: Array, null: Array) -> Array:
    """pinv(matrix) where ``null`` (n, 4) spans its null space: (A + s N N^T)^-1 - N N^T / s.

    s sits in the middle of the spectrum: far from either end it costs digits.
    """
    N, _ = np.linalg.qr(null)
    s = float(np.exp(np.mean(np.log(np.diagonal(matrix)))))
    return _inverse(matrix + s * (N @ N.T)) - N @ N.T / s


def motion_pseudo_inverse(equations: NormalEquations, state: State) -> Array:
    """(9N, 9N) motion block of pinv(H), the free gauge's covariance, with no column held on the way.

    The same matrix as :func:`motion_covariance` gives, from (S + s N N^T)^-1: what Eq. (12) makes
    of it is then no repetition of the fixed gauge's own inverse, but a test.

    Raises DegenerateError where more than the gauge is unobservable.
    """
    reduced = equations.eliminate()
    U = orbit_tangent(state)
    n_motion = 9 * state.n_keyframes
    G = _inverse_on_complement(reduced.matrix, U[:n_motion])
    taken, gram = reduced.couple(U[n_motion:])
    through = U[:n_motion] - taken
    G_U = G @ through
    return _low_rank_projection(G, G_U, gram + through.T @ G_U, U[:n_motion], U.T @ U)


def motion_covariance(problem: Problem, state: State, gauge: Gauge) -> Array:
    """(9N, 9N) covariance of the motion parameters in a gauge (m, rad, m/s).

    Fixed gauge: inverse of the reduced Hessian, zero rows where held. Prior: inverse with
    the prior added. Any other gauge, the free one included: projection by its normal.

    Raises DegenerateError where more than the gauge is unobservable.
    """
    return covariance_of(linearise(problem, state), state, gauge, problem.initial)


def covariance_of(equations: NormalEquations, state: State, gauge: Gauge, reference: State) -> Array:
    """As :func:`motion_covariance`, from normal equations at hand."""
    projection = GaugeProjection.of(equations.eliminate(), state, gauge, reference)
    return projection.apply(projection.inverse.dense())


@dataclass(frozen=True)
class GaugeProjection:
    """What takes G, the inverse with columns held, to a gauge: Q G Q^T + B B^T, motion block.

    With M = (V^T U)^-1, Q G Q^T is G - A W^T - W A^T, a rank-8 update with W = U M and
    A = G V - W (V^T G V) / 2. The landmarks enter through four columns only. Where the gauge
    is the one that G holds there is nothing to project and A is None.

    A prior on four gauge parameters says nothing about the shape, so its covariance is the one
    of the gauge with its normal V, plus the freedom B that it leaves along the orbit:
    B = U (V^T U)^-1 with V^T the prior's whitened Jacobian. That is exact at any weight, where
    an inverse of H + V V^T is not.

    ``A``, ``W``, ``B`` (9N, 4), or (9N + 3K, 4) with landmarks, or None: the package's order.
    """

    inverse: HeldInverse
    A: Array | None
    W: Array | None
    B: Array | None

    @classmethod
    def of(
        cls, reduced: ReducedSystem, state: State, gauge: Gauge, reference: State, *, landmarks: bool = False
    ) -> GaugeProjection:
        """The projection for a gauge; with ``landmarks`` their rows are computed too."""
        held, prior = gauge.held(state), gauge.prior(state, reference)
        if len(held):
            return cls(HeldInverse.of(reduced, held), None, None, None)
        inverse = HeldInverse.of(reduced, first_pose_columns(state))
        U = orbit_tangent(state)
        if prior is not None:
            V = _prior_normal(state, prior)
        else:
            V = U if type(gauge) is FreeGauge else gauge.normal(state)  # others derive from it
        rows = len(U) if landmarks else 9 * state.n_keyframes
        W = _times_inverse(U[:rows], V.T @ U)
        # A prior on what G holds says nothing of the shape.
        same = prior is not None and np.array_equal(prior.columns, inverse.held)
        A = None if same else cls._half_update(reduced, inverse, V, W, landmarks)
        return cls(inverse, A, W, W if prior is not None else None)

    @staticmethod
    def _half_update(
        reduced: ReducedSystem, inverse: HeldInverse, V: Array, W: Array, landmarks: bool
    ) -> Array:
        n_motion = 9 * reduced.structure.n_keyframes
        through: Array = V[:n_motion]
        V_G_V: Array = np.zeros((4, 4))
        if V[n_motion:].any():
            taken, V_G_V = reduced.couple(V[n_motion:])
            through = through - taken
        G_V = inverse.times(through)
        V_G_V = V_G_V + through.T @ G_V
        if landmarks:
            G_V = np.concatenate([G_V, reduced.through_landmarks(V[n_motion:], G_V)])
        return G_V - 0.5 * W @ V_G_V

    def apply(self, G: Array) -> Array:
        """The motion block (9N, 9N) in the gauge, from G dense, which is overwritten."""
        if self.A is not None and self.W is not None:
            symmetric.subtract_outer(G, self.A, self.W)
        return G if self.B is None else G + self.B @ self.B.T

    def apply_blocks(self, G: Array, rows: Index) -> Array:
        """Diagonal blocks (m, c, c) in the gauge over m sets of parameters (m, c), from those blocks of G."""
        if self.A is not None and self.W is not None:
            cross = self.A[rows] @ self.W[rows].swapaxes(-1, -2)
            G = G - cross - cross.swapaxes(-1, -2)
        return G if self.B is None else G + self.B[rows] @ self.B[rows].swapaxes(-1, -2)


def _prior_normal(state: State, prior: GaugePrior) -> Array:
    V = np.zeros((state.n_parameters, len(prior.residual)))
    V[prior.columns] = prior.jacobian.T
    return V


def _times_inverse(U: Array, V_T_U: Array) -> Array:
    """U (V^T U)^-1. Raises DegenerateError where the constraints leave part of the orbit free."""
    _, _, transposed, info = lapack.dgesv(V_T_U.T, U.T)
    if info > 0:
        raise DegenerateError("the gauge's constraints leave part of the gauge free")
    return transposed.T


def _low_rank_projection(G: Array, G_V: Array, V_G_V: Array, U: Array, V_T_U: Array) -> Array:
    """Q G Q^T from G, G V and V^T G V, for any number of constraints."""
    W = _times_inverse(U, V_T_U)
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
        for another shape, a matrix that is not symmetric, or a motion block where the gauge
        constrains landmarks
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
    asymmetry = float(np.linalg.norm(covariance - covariance.T) / np.linalg.norm(covariance))
    if not asymmetry < 1e-8:
        raise DataError("covariance", "must be finite and symmetric", field="asymmetry", value=asymmetry)
    blocks = transfer_blocks(state, moved, yaw, n // 3)
    carried = (blocks @ covariance.reshape(n // 3, 3, n)).reshape(n, n)
    carried = (blocks @ carried.T.reshape(n // 3, 3, n)).reshape(n, n)
    return project_covariance(carried, orbit_tangent(moved)[:n], V[:n]), moved
