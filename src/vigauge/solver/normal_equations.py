"""The normal equations H dx = -g in blocks, and the elimination of the landmarks.

H = J^T J has three kinds of block: one of the motion (9N x 9N, banded for long flights), a
6 x 3 block a (keyframe, landmark) pair, and a 3 x 3 block a landmark. The Schur complement
onto the motion, S = A - W C^-1 W^T (the reduced camera system), is all that is ever factorised.
Where biases are estimated, 9N is 15N here and in the rest of this module.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import DegenerateError, SolverError
from ..geometry import so3
from ..geometry.so3 import Array
from ..kernels import first_rotation as first_rotation_kernels
from ..kernels import reduced, schur, symmetric, visual
from ..kernels.lanes import LANES
from ..kernels.schur import Couplings
from ..model import first_rotation
from ..model.factors import LinearFactor
from ..model.problem import Problem
from ..model.state import State
from ..sparsity.layout import NOT_POSITIVE_DEFINITE, Index, Layout, by_keyframe
from ..sparsity.rounding import rounding
from ..sparsity.structure import Structure
from .factors import add_factor, linear_factors
from .residuals import camera_rotations, inertial_inputs, inertial_kernels
from .workers import ALONE, Workers

_NONE: Array = np.empty(0)


def coupling_blocks(structure: Structure, W: Couplings) -> Array:
    """(P, 6, 3) blocks W = -[M; hat(ray) M] of (position and left increment, landmark), one a pair."""
    pairs = structure.pairs
    M = W.information.reshape(-1, 6, LANES)[pairs.cell, :, pairs.lane][:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    ray = W.X_W[pairs.landmark] - W.p_W[pairs.keyframe]
    return np.concatenate([-M, -so3.hat(ray) @ M], axis=1)


@dataclass
class NormalEquations:
    """H and g of one linearisation point.

    The arrays are by left increments, Eq. (8). Whatever a method returns is by the package's
    parameters, the first rotation as in Eq. (9), and holds the ``total`` factors too.

    Attributes
    ----------
    storage : motion block A, as ``structure.layout`` stores it
    couplings : what the blocks W are made from
    landmark : (K, 3, 3) blocks C
    motion_gradient, landmark_gradient : (9N,) in stored order and (K, 3), the parts of g = J^T r
    chain : (3, 3) of :mod:`vigauge.model.first_rotation`
    total : motion factors in total increments, to be added to A
    """

    structure: Structure
    storage: Array
    couplings: Couplings
    landmark: Array
    motion_gradient: Array
    landmark_gradient: Array
    chain: Array
    total: tuple[LinearFactor, ...] = ()

    @property
    def motion(self) -> Array:
        """(9N, 9N) block A, dense."""
        storage, gradient = self.storage.copy(), self.motion_gradient.copy()
        self._to_total(storage, gradient)
        return self.structure.layout.dense(storage)

    @property
    def gradient(self) -> Array:
        """(9N + 3K,) g = J^T r."""
        return self.diagonal_and_gradient()[1]

    def diagonal(self) -> Array:
        """(9N + 3K,) diagonal of H."""
        return self.diagonal_and_gradient()[0]

    def diagonal_and_gradient(self) -> tuple[Array, Array]:
        """(9N + 3K,) diagonal of H, and g = J^T r."""
        layout = self.structure.layout
        n = layout.size + 3 * len(self.landmark)
        diagonal, gradient = np.empty(n), np.empty(n)
        first_rotation_kernels.total_equations(
            self.storage,
            self.motion_gradient,
            self.landmark,
            self.landmark_gradient,
            layout.stored,
            3 * self.structure.n_keyframes,
            layout.first_rotation,
            layout.stride,
            self.chain,
            diagonal,
            gradient,
        )
        for factor in self.total:
            symmetric.add_diagonal_and_gradient(
                diagonal, gradient, factor.columns, factor.jacobian, factor.residual
            )
        return diagonal, gradient

    def _to_total(self, storage: Array, gradient: Array, damping: Array = _NONE) -> None:
        """Take a stored system and its gradient to total increments, add factors and damping; in place."""
        layout = self.structure.layout
        _chart_to_total(layout, self.chain, storage, gradient, damping)
        for factor in self.total:
            add_factor(factor, layout, storage, gradient)

    def times(self, vector: Array) -> Array:
        """H x of a vector x (9N + 3K,), from the blocks."""
        s = self.structure
        n_motion = s.layout.size
        W, pairs = self.total_couplings(), s.pairs
        landmark = vector[n_motion:].reshape(-1, 3)
        out = self.motion @ vector[:n_motion]
        pose = vector[s.columns[:, :6]]
        rows = s.columns[pairs.keyframe, :6]
        np.add.at(out, rows, np.einsum("pij,pj->pi", W, landmark[pairs.landmark]))
        across = np.einsum("kij,kj->ki", self.landmark, landmark)
        np.add.at(across, pairs.landmark, np.einsum("pij,pi->pj", W, pose[pairs.keyframe]))
        return np.concatenate([out, across.ravel()])

    def total_couplings(self) -> Array:
        """(P, 6, 3) blocks W by the package's parameters, one a pair."""
        out, first = coupling_blocks(self.structure, self.couplings), self.structure.pairs.keyframe == 0
        out[first, 3:] = self.chain.T @ out[first, 3:]
        return out

    def with_factor(self, factor: LinearFactor) -> NormalEquations:
        """These equations and a motion factor."""
        self.structure.layout.require_near(self.structure.layout.stored[factor.columns])
        if factor.total:
            return replace(self, total=(*self.total, factor))
        out = replace(self, storage=self.storage.copy(), motion_gradient=self.motion_gradient.copy())
        add_factor(factor, self.structure.layout, out.storage, out.motion_gradient)
        return out

    def eliminate(self, damping: Array | None = None, workers: Workers = ALONE) -> ReducedSystem:
        """Schur complement onto the motion of H + diag(damping); damping is (9N + 3K,).

        Raises SolverError where a landmark block is not positive definite, and without damping
        DegenerateError where one is singular to rounding: a landmark seen along one line only.
        """
        s, layout = self.structure, self.structure.layout
        # Shares of several pieces are added to whole ranges, above the triangle too.
        storage = layout.copy(self.storage) if len(s.pieces) < 2 else self.storage.copy()
        gradient = self.motion_gradient.copy()
        added = _NONE if damping is None else damping
        factor, half_gradient = np.empty((s.n_batches, 6 * LANES)), np.empty((s.n_batches, 3 * LANES))

        def take_out(piece: tuple[int, int], base: int, into: Array, gradient: Array) -> float:
            return schur.eliminate(
                *self.couplings,
                self.landmark,
                added,
                self.landmark_gradient,
                s.group_batch,
                s.group_seen,
                s.seen,
                layout.pose,
                layout.stride,
                base,
                *piece,
                factor,
                half_gradient,
                into,
                gradient,
                *s.batches,
            )

        def apart(piece: tuple[int, int]) -> tuple[float, slice, Array, Array]:
            """A piece's share: the stored entries between its first and last keyframes."""
            stored = s.stored_by(piece)
            share, gradient = np.zeros(stored.stop - stored.start), np.zeros(layout.size)
            return take_out(piece, stored.start, share, gradient), stored, share, gradient

        smallest = [1.0]
        if s.pieces:
            others = workers.map(apart, s.pieces[1:])
            # The first piece goes where it belongs, and of short problems it is the only one.
            smallest.append(take_out(s.pieces[0], 0, storage, gradient))
            for found, stored, share, of_piece in others:
                smallest.append(found)
                storage[stored] += share
                gradient += of_piece
        regular = min(smallest)
        # A singular block is one to rounding: whether its determinant comes out positive is chance.
        if damping is None and not regular >= rounding(3) and _all_seen(self.landmark):
            raise DegenerateError(
                f"landmark {_weakest(self.landmark)} is unobservable along its line of sight"
            )
        if not regular > 0.0:
            raise SolverError("a landmark's block of H is not positive definite")
        self._to_total(storage, gradient, added)
        return ReducedSystem(s, storage, gradient, self.couplings, factor, half_gradient, self.chain)

    def dense(self) -> Array:
        """(9N + 3K, 9N + 3K) H itself: for small problems, tests and pictures."""
        s = self.structure
        n_motion = s.layout.size
        H = np.zeros((n_motion + 3 * s.n_landmarks,) * 2)
        H[:n_motion, :n_motion] = self.motion
        rows = s.columns[s.pairs.keyframe, :6][:, :, None]
        columns = (n_motion + 3 * s.pairs.landmark[:, None] + np.arange(3))[:, None, :]
        W = self.total_couplings()
        H[rows, columns] = W
        H[columns, rows] = W
        index = n_motion + np.arange(3 * s.n_landmarks).reshape(-1, 3)
        H[index[:, :, None], index[:, None, :]] = self.landmark
        return H


@dataclass
class ReducedSystem:
    """Reduced camera system S dx = -b, and what back-substitution needs.

    ``storage`` S, as ``structure.layout`` stores it; ``motion_gradient`` (9N,) b in stored order;
    ``couplings`` W; ``factor`` (B, 6 LANES) F, lower triangular by columns with F^T F = C^-1, and
    ``half_gradient`` (B, 3 LANES) F g_landmark, by batches of landmarks. S and b are by the package's
    parameters, W by left increments; ``chain`` as in :class:`NormalEquations`.
    """

    structure: Structure
    storage: Array
    motion_gradient: Array
    couplings: Couplings
    factor: Array
    half_gradient: Array
    chain: Array

    @property
    def matrix(self) -> Array:
        """(9N, 9N) S, dense, in the package's order."""
        return self.structure.layout.dense(self.storage)

    @property
    def gradient(self) -> Array:
        """(9N,) b in the package's order."""
        return self.motion_gradient[self.structure.layout.stored]

    def solve(self, held: Index, *, overwrite: bool = False) -> Array:
        """The full step (9N + 3K,), zero in the ``held`` motion columns.

        With ``overwrite`` the factor is written over ``storage``, and this system is spent.

        Raises SolverError where the reduced system is not positive definite.
        """
        s, layout = self.structure, self.structure.layout
        step = np.empty(layout.size + 3 * s.n_landmarks)
        if not reduced.solve(
            self.storage if overwrite else self.storage.copy(),
            self.motion_gradient,
            held,
            layout.stored,
            layout.pose,
            layout.stride,
            layout.half_bandwidth,
            layout.first_rotation,
            self.chain,
            self.factor,
            self.half_gradient,
            *self.couplings,
            step,
            *s.batches,
        ):
            raise SolverError(NOT_POSITIVE_DEFINITE)
        return step

    def couple(self, landmark: Array) -> tuple[Array, Array]:
        """W C^-1 V (9N, d) and V^T C^-1 V (d, d) of landmark columns V (3K, d)."""
        s, d = self.structure, landmark.shape[1]
        out, gram = np.zeros((s.layout.width // 3, s.n_keyframes, 3, d)), np.zeros((d, d))
        schur.couple(self.couplings, self.factor, s.batches, landmark.reshape(-1, 3, d), out, gram)
        out[1, 0] = self.chain.T @ out[1, 0]
        return out.reshape(-1, d), gram

    def landmark_inverses(self) -> Array:
        """(K, 3, 3) C^-1 = F^T F."""
        batch, lane = self.structure.landmark_lane
        F = np.zeros((self.structure.n_landmarks, 3, 3))
        row, column = np.array([0, 1, 2, 1, 2, 2]), np.array([0, 0, 0, 1, 1, 2])
        F[:, row, column] = self.factor.reshape(-1, 6, LANES)[batch, :, lane]
        return F.swapaxes(1, 2) @ F

    def through_landmarks(self, landmark: Array, motion: Array) -> Array:
        """C^-1 (V - W^T Y) of landmark columns V (3K, c) and motion columns Y (9N, c): (3K, c)."""
        s = self.structure
        left = first_rotation.to_left(motion, s.n_keyframes, self.chain)
        pose = by_keyframe(left, s.n_keyframes)[s.pairs.keyframe, :6]
        W_T_Y = coupling_blocks(s, self.couplings).swapaxes(1, 2) @ pose
        coupled = np.add.reduceat(W_T_Y, s.pairs.begin[:-1], axis=0)
        step = self.landmark_inverses() @ (landmark.reshape(coupled.shape) - coupled)
        return step.reshape(landmark.shape)


def _chart_to_total(
    layout: Layout, chain: Array, storage: Array, gradient: Array, damping: Array = _NONE
) -> None:
    """Take a stored system and its gradient from left to total increments of the first rotation, in place."""
    first_rotation_kernels.system_to_total(
        storage,
        gradient,
        layout.first_rotation,
        layout.width,
        layout.stride,
        layout.half_bandwidth,
        chain,
        layout.stored,
        damping,
    )


def _all_seen(landmark: Array) -> bool:
    """Whether every block is finite and has information along all three axes."""
    return bool(np.all(np.isfinite(landmark)) and np.all(np.diagonal(landmark, axis1=1, axis2=2) > 0.0))


def _weakest(landmark: Array) -> int:
    """The landmark whose block is the nearest to singular, scaled to a unit diagonal."""
    scale = 1.0 / np.sqrt(np.diagonal(landmark, axis1=1, axis2=2))
    eigenvalues = np.linalg.eigvalsh(landmark * scale[:, :, None] * scale[:, None, :])
    return int(np.argmin(eigenvalues[:, 0]))


def linearise(
    problem: Problem,
    state: State,
    workers: Workers = ALONE,
    *,
    R_CW: Array | None = None,
    spent: NormalEquations | None = None,
    prior: LinearFactor | None = None,
) -> NormalEquations:
    """H = J^T J and g = J^T r of Eq. (1) at a state, without any gauge.

    With a loss, reprojection errors count by their weights: H = J^T diag(rho') J and g = J^T diag(rho') r.
    ``prior``, in total increments, is added to the factors of the problem. ``R_CW`` where it is known, see
    :func:`vigauge.solver.residuals.camera_rotations`. ``spent`` equations of the same problem give up their
    large arrays, which are overwritten: fresh memory costs as much as the sums that fill it.
    """
    s = problem.structure
    layout, cameras = s.layout, problem.camera_arrays
    rotations = camera_rotations(problem, state) if R_CW is None else R_CW
    information: Array = np.empty((s.n_cells, 6 * LANES)) if spent is None else spent.couplings.information
    landmark: Array = np.empty((s.n_landmarks, 3, 3)) if spent is None else spent.landmark
    landmark_gradient = np.empty((s.n_landmarks, 3)) if spent is None else spent.landmark_gradient

    def accumulate(piece: tuple[int, int]) -> Array:
        pose = np.zeros((s.n_keyframes, visual.POSE_ENTRIES))
        visual.accumulate(
            state.p_W,
            state.X_W,
            rotations,
            cameras["p_CB"],
            cameras["intrinsics"],
            problem.pixels,
            *problem.compiled_loss,
            int(s.group_batch[piece[0]]),
            int(s.group_batch[piece[1]]),
            information,
            landmark,
            landmark_gradient,
            pose,
            *s.batches,
        )
        return pose

    shares = list(workers.map(accumulate, s.pieces))
    pose = sum(shares[1:], shares[0]) if shares else np.zeros((s.n_keyframes, visual.POSE_ENTRIES))
    storage, gradient = layout.zeros(None if spent is None else spent.storage), np.zeros(layout.size)
    visual.spread_poses(pose, layout.pose, layout.stride, storage, gradient)
    inertial_kernels(problem).accumulate(
        layout.pose, layout.speed, layout.stride, storage, gradient, *inertial_inputs(problem, state)
    )
    total: tuple[LinearFactor, ...] = ()
    for factor in linear_factors(problem, state):
        if factor.total:
            total += (factor,)
        else:
            add_factor(factor, layout, storage, gradient)
    if prior is not None:
        total += (prior,)
    couplings = Couplings(information, state.p_W, state.X_W)
    chain = first_rotation.chain(state)
    return NormalEquations(s, storage, couplings, landmark, gradient, landmark_gradient, chain, total)


def inertial_information(problem: Problem, state: State) -> Array:
    """(9N, 9N) share of the inertial factors in H; they do not see the landmarks."""
    problem.initial.require_size(state)
    layout = problem.structure.layout
    storage, gradient = np.zeros(layout.length), np.zeros(layout.size)
    inertial_kernels(problem).accumulate(
        layout.pose, layout.speed, layout.stride, storage, gradient, *inertial_inputs(problem, state)
    )
    _chart_to_total(layout, first_rotation.chain(state), storage, gradient)
    return layout.dense(storage)
