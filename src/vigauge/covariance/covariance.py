"""Covariances in any gauge from one elimination (Section VI, Appendix A).

All of them are one family. Let G be any symmetric matrix with H G H = H. Then Q G Q^T,
with the oblique projector Q = I - U (V^T U)^-1 V^T of Eq. (14), is the covariance in the
gauge with normal V, whichever G was used. V = U gives the Moore-Penrose inverse, the free
gauge. G is the inverse of the reduced camera system with some columns held, and the null
space is known in closed form (15), so nothing is ever decomposed into singular values, and
the cost grows linearly with the number of landmarks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg

from ..arrays import indices as indices_of
from ..arrays import instance, integer, reals
from ..errors import DataError
from ..gauge.gauges import FixedGauge, FreeGauge, Gauge, first_pose_columns
from ..gauge.group import Group, YawTranslation, local_tangent
from ..geometry import so3
from ..geometry.so3 import Array
from ..kernels import symmetric
from ..model.factors import LinearFactor
from ..model.problem import Problem
from ..model.state import State
from ..observability.orbit import open_directions, seen_along
from ..observability.spectrum import Spectrum
from ..solver.normal_equations import NormalEquations, ReducedSystem, linearise
from ..sparsity.layout import Index
from .foreign import generalised_inverse
from .held_inverse import HeldInverse
from .information import from_hessian, from_jacobian, from_schur
from .projection import along_orbit, low_rank_projection
from .relative import RelativePose, is_still, relative_pose

# Entries of G that are gathered at a time: two megabytes.
_AT_ONCE = 250_000
# In the order of a keyframe's columns.
_KINDS = ("position", "rotation", "velocity", "gyro_bias", "accel_bias")


@dataclass(frozen=True, repr=False)
class Covariance:
    """The covariance of an estimate, to be asked for in one gauge after another.

    :meth:`of` linearises and eliminates the landmarks once; the inverse is made at the first
    question and serves all gauges. Units m, rad, m/s. Rotations are left increments in W, the
    first one the total increment of Eq. (9). Where biases are estimated, 9N and 9 are 15N and 15 here: the
    gyroscope's (rad/s) and the accelerometer's (m/s^2) follow the velocities.

    H is J^T J of the cost 1/2 ||r||^2, without damping. With a loss, reprojection errors count in it by
    their weights rho', as in the covariance of Ceres. Where there are many outliers sigmas are then too
    small, as :func:`vigauge.sandwich` says.

    Attributes
    ----------
    equations : H and g at the state, without any gauge
    state, reference : estimate, and the initial state of the problem
    U : (9N + 3K, d) directions that no measurement sees, a basis of the null space of H
    measured : names of the group's directions that a motion factor measures ("yaw", "x", ...). Where
        that is not all or none of a group, the open directions are combinations of them
    group : the group whose orbit is looked at

    Raises DegenerateError, at the first question, where more than the group is unobservable.
    """

    equations: NormalEquations
    state: State
    reference: State
    U: Array
    measured: tuple[str, ...]
    group: Group

    @classmethod
    def of(cls, problem: Problem, state: State, group: Group | None = None) -> Covariance:
        """The covariance of a problem's estimate.

        Images and inertial measurements do not change along the orbit of ``group`` (yaw and
        translation by default). Directions of it that a motion factor of the problem measures are
        taken out of ``U``.

        Raises DataError where state and problem differ in size.
        """
        instance("problem", problem, Problem)
        instance("state", state, State)
        return cls.from_equations(linearise(problem, state), problem, state, group)

    @classmethod
    def from_equations(
        cls, equations: NormalEquations, problem: Problem, state: State, group: Group | None = None
    ) -> Covariance:
        """As :meth:`of`, from normal equations at hand."""
        group = YawTranslation() if group is None else group
        tangent = local_tangent(group, state.require_valid())
        if not problem.factors:
            return cls(equations, state, problem.initial, tangent, (), group)
        along = seen_along(problem, state, tangent)
        measured: list[bool] = (along != 0.0).any(axis=0).tolist()
        names = tuple(name for name, seen in zip(group.directions, measured, strict=True) if seen)
        U = tangent @ open_directions(along) if names else tangent
        return cls(equations, state, problem.initial, U, names, group)

    # Of anyone's estimate: from its information matrix, its Jacobian, or its Schur complement.
    from_hessian = staticmethod(from_hessian)
    from_jacobian = staticmethod(from_jacobian)
    from_schur = staticmethod(from_schur)

    @cached_property
    def reduced(self) -> ReducedSystem:
        """The reduced camera system: H with the landmarks eliminated."""
        return self.equations.eliminate()

    @cached_property
    def inverse(self) -> HeldInverse:
        """G: the inverse with as many columns held as there are open directions."""
        return HeldInverse.of(self.reduced, self._held)

    @cached_property
    def _held(self) -> Index:
        if isinstance(self.group, YawTranslation) and not self.measured:
            return first_pose_columns(self.state)
        motion = self.U[: self.state.n_motion]
        # Rows of U that are far from dependent: holding them stops every open direction.
        layout = self.reduced.structure.layout
        scale = np.sqrt(layout.diagonal(self.reduced.storage)[layout.stored])
        _, _, pivots = scipy.linalg.qr((motion * scale[:, None]).T, mode="economic", pivoting=True)
        return np.sort(pivots[: self.U.shape[1]]).astype(np.int64)

    def spectrum(self, held: Index | None = None) -> Spectrum:
        """Eigenvalues of the scaled reduced camera system, without the ``held`` columns."""
        return Spectrum.of(self.reduced, held)

    def motion(self, gauge: Gauge) -> Array:
        """(9N, 9N) covariance of all positions, all rotations, all velocities in a gauge.

        Fixed gauge: zero rows where held. Prior: the fixed gauge's shape plus the freedom that the
        prior leaves along the orbit. Any other gauge: the projection by its normal V, Eq. (14).
        """
        return self._projection(gauge).apply(self.inverse.dense())

    def __repr__(self) -> str:
        size = f"{self.state.n_keyframes} keyframes, {self.state.n_landmarks} landmarks"
        return f"Covariance({size}, group={self.group}, measured={self.measured})"

    def keyframes(self, gauge: Gauge, indices: Sequence[int] | Index | None = None) -> Array:
        """(m, 9, 9) covariances of (position, rotation, velocity) of some keyframes, all by default.

        Raises DataError for a keyframe that is not there.
        """
        columns = self._columns(indices)
        return self._projection(gauge).apply_blocks(self.inverse.blocks(columns), columns)

    def joint(self, gauge: Gauge, indices: Sequence[int] | Index) -> Array:
        """(9m, 9m) covariance of some keyframes together, cross terms included.

        Order: (position, rotation, velocity) of the first index, then of the next. For systems
        stored as a band the columns of G are solved for, so the whole inverse is never formed.

        Raises DataError for a keyframe that is not there.
        """
        columns = self._columns(indices).reshape(1, -1)
        return self._projection(gauge).apply_blocks(self.inverse.across(columns[0])[None], columns)[0]

    def sigma(self, kind: str, gauge: Gauge) -> Array:
        """(N, 3) standard deviations of one kind of all keyframes, or of "points" (K, 3).

        ``kind``: "position", "rotation", "velocity"; where they are estimated "gyro_bias" and "accel_bias".

        Raises DataError for another kind.
        """
        kinds = [*_KINDS[: self.state.width // 3], "points"]
        if kind not in kinds:
            raise DataError("kind", f"must be one of {', '.join(kinds)}", value=kind)
        at = 3 * kinds.index(kind)
        blocks = (
            self.landmarks(gauge) if kind == "points" else self.keyframes(gauge)[:, at : at + 3, at : at + 3]
        )
        return np.sqrt(np.maximum(np.einsum("kcc->kc", blocks), 0.0))

    def relative_pose(self, i: int, j: int, gauge: Gauge | None = None) -> RelativePose:
        """The pose of keyframe j in keyframe i's frame, with its covariance, which no gauge changes.

        Where the scale is open it does depend on the gauge, which must then be given.

        Raises DataError for a keyframe that is not there, and where the scale is open and no gauge given.
        """
        i, j = integer("i", i), integer("j", j)
        columns = self._columns([i, j])[:, :6]
        R, p = self.state.R_WB, self.state.p_W
        pose, *by_pose = relative_pose(R[i], p[i], R[j], p[j])
        for keyframe, J_k in zip((i, j), by_pose, strict=True):
            if keyframe == 0:  # its increment is the total one
                J_k[:, 3:] = J_k[:, 3:] @ so3.left_jacobian(self.state.dphi_0)
        J = np.concatenate(by_pose, axis=1)
        if gauge is None and not is_still(J, self.U[columns.ravel()]):
            raise DataError("gauge", "must be given: an open direction (the scale?) moves relative poses")
        if gauge is None:  # any will do
            gauge = FixedGauge() if isinstance(self.group, YawTranslation) else FreeGauge(group=self.group)
        joint = self.joint(gauge, [i, j])
        used = np.concatenate([np.arange(6), self.state.width + np.arange(6)])
        covariance = J @ joint[np.ix_(used, used)] @ J.T
        return replace(pose, covariance=0.5 * (covariance + covariance.T))

    def landmarks(self, gauge: Gauge, indices: Sequence[int] | Index | None = None) -> Array:
        """(m, 3, 3) covariances of some landmarks' positions, all by default, m^2.

        Raises DataError for a landmark that is not there.
        """
        wanted = indices_of("landmarks", indices, self.state.n_landmarks)
        projection = self._projection(gauge, landmarks=True)
        s, n_motion = self.reduced.structure, self.state.n_motion
        W, inverses = self.equations.total_couplings(), self.reduced.landmark_inverses()
        first, end = s.pairs.begin[wanted], s.pairs.begin[wanted + 1]
        out = np.empty((len(wanted), 3, 3))
        # Landmarks with equally many pairs together, not too many at a time.
        for count in np.unique(end - first):
            alike = np.flatnonzero(end - first == count)
            for some in np.array_split(alike, 1 + len(alike) * (6 * int(count)) ** 2 // _AT_ONCE):
                pairs = first[some, None] + np.arange(count)
                columns = s.columns[s.pairs.keyframe[pairs], :6].reshape(len(some), -1)
                seen = W[pairs].reshape(len(some), -1, 3)
                C_inverse = inverses[wanted[some]]
                G = C_inverse @ (seen.swapaxes(1, 2) @ self.inverse.blocks(columns) @ seen) @ C_inverse
                rows = n_motion + 3 * wanted[some, None] + np.arange(3)
                out[some] = projection.apply_blocks(C_inverse + G, rows)
        return out

    def _columns(self, indices: Sequence[int] | Index | None) -> Index:
        return self.reduced.structure.columns[indices_of("keyframes", indices, self.state.n_keyframes)]

    def _projection(self, gauge: Gauge, *, landmarks: bool = False) -> _Projection:
        return _Projection.of(self, gauge, landmarks)


@dataclass(frozen=True)
class _Projection:
    """What takes G, the inverse with columns held, to a gauge: Q G Q^T + B B^T.

    With M = (V^T U)^-1, Q G Q^T is G - A W^T - W A^T, an update of rank 2d with W = U M and
    A = G V - W (V^T G V) / 2. The landmarks enter through d columns only. Where the gauge
    is the one that G holds there is nothing to project and A is None.

    A prior on gauge parameters says nothing about the shape, so its covariance is the one
    of the gauge with its normal V, plus the freedom B that it leaves along the orbit:
    B = U (V^T U)^-1 with V^T the prior's whitened Jacobian. That is exact at any weight, where
    an inverse of H + V V^T is not.

    ``A``, ``W``, ``B`` (9N, d), or (9N + 3K, d) with landmarks, or None: the package's order.
    ``held`` rows are zero in the gauge.
    """

    A: Array | None
    W: Array | None
    B: Array | None
    held: Index

    @classmethod
    def of(cls, covariance: Covariance, gauge: Gauge, landmarks: bool) -> _Projection:
        state, U = covariance.state, covariance.U
        gauge = instance("gauge", gauge, Gauge)
        held, prior = gauge.held(state), gauge.prior(state, covariance.reference)
        if held is covariance._held or np.array_equal(held, covariance._held):
            return cls(None, None, None, held[:0])  # G's own rows are zero there
        if not U.shape[1]:
            return cls(None, None, None, held[:0])
        same_as_free = isinstance(gauge, FreeGauge) and gauge.group == covariance.group
        V = U if same_as_free else _normal(covariance, gauge, prior)
        rows = len(U) if landmarks else state.n_motion
        W = along_orbit(U, V, rows)
        # A prior on what G holds says nothing of the shape.
        same = prior is not None and np.array_equal(prior.columns, covariance._held)
        A = None if same else cls._half_update(covariance, V, W, landmarks)
        return cls(
            A,
            W,
            W if prior is not None else None,
            held[:0] if same_as_free or prior is not None else _single_rows(V),
        )

    @staticmethod
    def _half_update(covariance: Covariance, V: Array, W: Array, landmarks: bool) -> Array:
        reduced, n_motion = covariance.reduced, covariance.state.n_motion
        through: Array = V[:n_motion]
        V_G_V: Array = np.zeros((V.shape[1],) * 2)
        if V[n_motion:].any():
            taken, V_G_V = reduced.couple(V[n_motion:])
            through = through - taken
        G_V = covariance.inverse.times(through)
        V_G_V = V_G_V + through.T @ G_V
        if landmarks:
            G_V = np.concatenate([G_V, reduced.through_landmarks(V[n_motion:], G_V)])
        return G_V - 0.5 * W @ V_G_V

    def apply(self, G: Array) -> Array:
        """The motion block (9N, 9N) in the gauge, from G dense, which is overwritten."""
        if self.A is not None and self.W is not None:
            symmetric.subtract_outer(G, self.A, self.W)
        if self.B is not None:
            return G + self.B @ self.B.T
        if len(self.held):
            held = self.held[self.held < len(G)]
            G[held], G[:, held] = 0.0, 0.0
        return G

    def apply_blocks(self, G: Array, rows: Index) -> Array:
        """Diagonal blocks (m, c, c) in the gauge over m sets of parameters (m, c), from those blocks of G."""
        if self.A is not None and self.W is not None:
            cross = self.A[rows] @ self.W[rows].swapaxes(-1, -2)
            G = G - cross - cross.swapaxes(-1, -2)
        if self.B is not None:
            return G + self.B[rows] @ self.B[rows].swapaxes(-1, -2)
        if not len(self.held):
            return G
        zero = np.isin(rows, self.held)
        return np.where(zero[..., :, None] | zero[..., None, :], 0.0, G)


def _normal(covariance: Covariance, gauge: Gauge, prior: LinearFactor | None) -> Array:
    """V (n, d): the gauge's constraints, or those combinations of them that stop the open directions."""
    state, U = covariance.state, covariance.U
    if prior is None:
        V = reals(f"normal of gauge '{gauge.name}'", gauge.normal(state), (len(U), "d"))
    else:
        V = np.zeros((state.n_parameters, len(prior.residual)))
        V[prior.columns] = prior.jacobian.T
    if V.shape[1] == U.shape[1]:
        return V
    if V.shape[1] < U.shape[1]:
        raise DataError(
            "gauge", f"'{gauge.name}' must constrain all {U.shape[1]} open directions", value=V.shape[1]
        )
    if prior is not None:
        raise DataError(
            "gauge",
            f"'{gauge.name}' is a prior on directions of which motion factors measure"
            f" {', '.join(covariance.measured)}; give it to the problem as a motion factor instead",
        )
    # V M^T is dual to the group's tangent; what belongs to the open directions is kept.
    tangent = local_tangent(covariance.group, state)
    coordinates = np.linalg.lstsq(tangent, U, rcond=None)[0]
    return along_orbit(V, tangent) @ coordinates


def _single_rows(V: Array) -> Index:
    """Rows that a constraint of V names alone: they do not move in the gauge."""
    single = np.count_nonzero(V, axis=0) == 1
    return np.flatnonzero(V[:, single].any(axis=1))


def motion_pseudo_inverse(covariance: Covariance) -> Array:
    """(9N, 9N) motion block of pinv(H), the free gauge's covariance, with no column held on the way.

    The same matrix as :meth:`Covariance.motion` gives, from (S + s N N^T)^-1: what Eq. (12) makes
    of it is then no repetition of the fixed gauge's own inverse, but a test.

    Raises DegenerateError where more than the gauge is unobservable.
    """
    reduced, U = covariance.reduced, covariance.U
    n_motion = covariance.state.n_motion
    G, _ = generalised_inverse(reduced.matrix, U[:n_motion])
    taken, gram = reduced.couple(U[n_motion:])
    through = U[:n_motion] - taken
    G_U = G @ through
    return low_rank_projection(G, G_U, gram + through.T @ G_U, along_orbit(U, U, n_motion))


def motion_covariance(problem: Problem, state: State, gauge: Gauge) -> Array:
    """(9N, 9N) covariance of the motion parameters in a gauge (m, rad, m/s).

    ``Covariance.of(problem, state).motion(gauge)``: the problem is linearised at ``state``, the
    landmarks are eliminated, the reduced system is inverted with the first position and yaw held, and
    the inverse is projected onto the gauge. For several gauges keep the :class:`Covariance`.

    Raises DegenerateError where more than the gauge is unobservable.
    """
    return Covariance.of(problem, state).motion(gauge)


def keyframe_covariances(
    problem: Problem, state: State, gauge: Gauge, keyframes: Sequence[int] | Index | None = None
) -> Array:
    """(m, 9, 9) covariances of (position, rotation, velocity) of some keyframes: diagonal blocks of
    :func:`motion_covariance`, without the whole matrix. See :meth:`Covariance.keyframes`."""
    return Covariance.of(problem, state).keyframes(gauge, keyframes)


def landmark_covariances(
    problem: Problem, state: State, gauge: Gauge, landmarks: Sequence[int] | Index | None = None
) -> Array:
    """(m, 3, 3) covariances of some landmarks' positions. See :meth:`Covariance.landmarks`."""
    return Covariance.of(problem, state).landmarks(gauge, landmarks)
