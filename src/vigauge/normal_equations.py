"""The normal equations H dx = -g in blocks, and the elimination of the landmarks.

H = J^T J has three kinds of block: one of the motion (9N x 9N, banded for long flights), a
6 x 3 block a (keyframe, landmark) pair, and a 3 x 3 block a landmark. The Schur complement
onto the motion, S = A - W C^-1 W^T (the reduced camera system), is all that is ever factorised.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg.blas as blas

from .errors import DegenerateError, SolverError
from .kernels import inertial as inertial_kernels
from .kernels import schur, visual
from .layout import Index, Layout, by_keyframe, by_kind
from .problem import Problem
from .residuals import camera_rotations, first_rotation_chain, inertial_inputs
from .so3 import Array
from .state import State
from .structure import CovisibleGroup, Structure
from .workers import ALONE, Workers


@dataclass(frozen=True)
class NormalEquations:
    """H and g of one linearisation point.

    Attributes
    ----------
    storage : motion block A, as ``structure.layout`` stores it
    pair : (P, 6, 3) blocks W of (position and rotation, landmark)
    landmark : (K, 3, 3) blocks C
    keyframe_gradient, landmark_gradient : (N, 9) and (K, 3) parts of g = J^T r
    """

    structure: Structure
    storage: Array
    pair: Array
    landmark: Array
    keyframe_gradient: Array
    landmark_gradient: Array

    @property
    def motion(self) -> Array:
        """(9N, 9N) block A, dense, in the package's order."""
        return self.structure.layout.dense(self.storage)

    @property
    def gradient(self) -> Array:
        """(9N + 3K,) g = J^T r."""
        return np.concatenate([by_kind(self.keyframe_gradient), self.landmark_gradient.ravel()])

    def diagonal(self) -> Array:
        """(9N + 3K,) diagonal of H."""
        layout = self.structure.layout
        motion = by_kind(layout.from_stored(layout.diagonal(self.storage)))
        return np.concatenate([motion, self.landmark.reshape(-1, 9)[:, ::4].ravel()])

    def times(self, vector: Array) -> Array:
        """H x of a vector x (9N + 3K,), from the blocks."""
        s = self.structure
        n_motion = s.layout.size
        landmark = vector[n_motion:].reshape(-1, 3)
        out = self.motion @ vector[:n_motion]
        pose = vector[s.columns[:, :6]]
        np.add.at(
            out,
            s.columns[s.pair_keyframe, :6],
            np.einsum("pij,pj->pi", self.pair, landmark[s.pair_landmark]),
        )
        across = np.einsum("kij,kj->ki", self.landmark, landmark)
        np.add.at(across, s.pair_landmark, np.einsum("pij,pi->pj", self.pair, pose[s.pair_keyframe]))
        return np.concatenate([out, across.ravel()])

    def with_prior(self, columns: Index, residual: Array, jacobian: Array) -> NormalEquations:
        """Add a whitened residual that depends on the motion parameters ``columns`` only."""
        out = replace(self, storage=self.storage.copy(), keyframe_gradient=self.keyframe_gradient.copy())
        out.add_prior(columns, residual, jacobian)
        return out

    def add_prior(self, columns: Index, residual: Array, jacobian: Array) -> None:
        """:meth:`with_prior` in place."""
        layout = self.structure.layout
        layout.add(self.storage, columns, jacobian.T @ jacobian)
        self.keyframe_gradient.reshape(-1)[layout.by_keyframe[columns]] += jacobian.T @ residual

    def eliminate(self, damping: Array | None = None, workers: Workers = ALONE) -> ReducedSystem:
        """Schur complement onto the motion of H + diag(damping); damping is (9N + 3K,).

        Raises SolverError where a landmark block is not positive definite, and without damping
        DegenerateError where one is singular to rounding: a landmark seen along one line only.
        """
        s, layout = self.structure, self.structure.layout
        storage, gradient = self.storage.copy(), self.keyframe_gradient.copy()
        if damping is None:
            landmark_damping: Array = np.zeros((s.n_landmarks, 3))
        else:
            n_motion = layout.size
            layout.diagonal(storage)[:] += layout.to_stored(by_keyframe(damping[:n_motion], s.n_keyframes))
            landmark_damping = damping[n_motion:].reshape(-1, 3)
        factor, half_gradient = np.empty_like(self.landmark), np.empty_like(self.landmark_gradient)
        pivot = schur.factorise(
            self.landmark, landmark_damping, self.landmark_gradient, factor, half_gradient
        )
        if not pivot > 0.0:
            raise SolverError("a landmark's block of H is not positive definite")
        if damping is None and pivot < 1e3 * np.finfo(float).eps:
            raise DegenerateError(
                f"landmark {_weakest(self.landmark)} is unobservable along its line of sight"
            )

        def product(group: CovisibleGroup) -> tuple[Array, Array]:
            width = len(group.keyframes)
            spread = np.empty((3 * len(group.landmarks), 6 * width))
            taken = np.zeros((width, 6))
            schur.spread(
                self.pair, factor, half_gradient, group.landmarks, s.landmark_pair, s.pair_row, spread, taken
            )
            return blas.dsyrk(1.0, spread.T, lower=1), taken

        for group, (square, taken) in zip(s.groups, workers.map(product, s.groups), strict=True):
            schur.scatter(square, taken, group.keyframes, layout.column, layout.stride, storage, gradient)
        return ReducedSystem(s, storage, gradient, self.pair, factor, half_gradient)

    def dense(self) -> Array:
        """(9N + 3K, 9N + 3K) H itself: for small problems, tests and pictures."""
        s = self.structure
        n_motion = 9 * s.n_keyframes
        H = np.zeros((n_motion + 3 * s.n_landmarks,) * 2)
        H[:n_motion, :n_motion] = self.motion
        rows = s.columns[s.pair_keyframe, :6][:, :, None]
        columns = (n_motion + 3 * s.pair_landmark[:, None] + np.arange(3))[:, None, :]
        H[rows, columns] = self.pair
        H[columns, rows] = self.pair
        index = n_motion + np.arange(3 * s.n_landmarks).reshape(-1, 3)
        H[index[:, :, None], index[:, None, :]] = self.landmark
        return H


@dataclass(frozen=True)
class ReducedSystem:
    """Reduced camera system S dx = -b, and what back-substitution needs.

    ``storage`` S, as ``structure.layout`` stores it; ``keyframe_gradient`` (N, 9) b; ``pair``
    (P, 6, 3) W; ``factor`` (K, 3, 3) F, lower triangular with F^T F = C^-1; ``half_gradient``
    (K, 3) F g_landmark.
    """

    structure: Structure
    storage: Array
    keyframe_gradient: Array
    pair: Array
    factor: Array
    half_gradient: Array

    @property
    def matrix(self) -> Array:
        """(9N, 9N) S, dense, in the package's order."""
        return self.structure.layout.dense(self.storage)

    @property
    def gradient(self) -> Array:
        """(9N,) b in the package's order."""
        return by_kind(self.keyframe_gradient)

    def solve(self, held: Index) -> Array:
        """The full step (9N + 3K,), zero in the ``held`` motion columns.

        Raises SolverError where the reduced system is not positive definite.
        """
        layout = self.structure.layout
        storage, right = self.storage.copy(), -layout.to_stored(self.keyframe_gradient)
        if len(held):
            layout.hold(storage, held)
            right[layout.stored[held]] = 0.0
        motion = layout.from_stored(layout.factorise(storage).solve(right))
        return np.concatenate([by_kind(motion), self.back_substitute(motion).ravel()])

    def couple(self, landmark: Array) -> tuple[Array, Array]:
        """W C^-1 V (9N, 4) and V^T C^-1 V (4, 4) of landmark columns V (3K, 4)."""
        s = self.structure
        out, gram = np.zeros((s.n_keyframes, 9, 4)), np.zeros((4, 4))
        schur.couple(
            self.pair, self.factor, s.landmark_pair, s.pair_keyframe, landmark.reshape(-1, 3, 4), out, gram
        )
        return by_kind(out), gram

    def through_landmarks(self, landmark: Array, motion: Array) -> Array:
        """C^-1 (V - W^T Y) of landmark columns V (3K, c) and motion columns Y (9N, c): (3K, c)."""
        s = self.structure
        pose = by_keyframe(motion, s.n_keyframes)[s.pair_keyframe, :6]
        coupled = np.add.reduceat(self.pair.swapaxes(1, 2) @ pose, s.landmark_pair[:-1], axis=0)
        half = self.factor @ (landmark.reshape(coupled.shape) - coupled)
        return (self.factor.swapaxes(1, 2) @ half).reshape(landmark.shape)

    def back_substitute(self, motion: Array) -> Array:
        """(K, 3) landmark steps that go with a motion step (N, 9) by keyframe."""
        s = self.structure
        out = np.empty_like(self.half_gradient)
        schur.back_substitute(
            self.pair, self.factor, self.half_gradient, s.landmark_pair, s.pair_keyframe, motion, out
        )
        return out


def _weakest(landmark: Array) -> int:
    """The landmark whose last pivot is the smallest against its diagonal entry."""
    root = np.linalg.cholesky(landmark)
    pivot = np.diagonal(root, axis1=1, axis2=2) ** 2 / np.diagonal(landmark, axis1=1, axis2=2)
    return int(np.argmin(pivot.min(axis=1)))


def linearise(
    problem: Problem, state: State, workers: Workers = ALONE, spent: NormalEquations | None = None
) -> NormalEquations:
    """H = J^T J and g = J^T r of Eq. (1) at a state, without any gauge.

    ``spent`` equations of the same problem give up their large arrays, which are overwritten:
    fresh memory costs as much as the sums that fill it.
    """
    s = problem.structure
    layout = s.layout
    chain = first_rotation_chain(state)
    R_CW, p_CB = camera_rotations(problem, state)
    storage, gradient = np.zeros(layout.length), np.zeros((s.n_keyframes, 9))
    pair: Array = np.empty((len(s.pair_keyframe), 6, 3)) if spent is None else spent.pair
    landmark: Array = np.empty((s.n_landmarks, 3, 3)) if spent is None else spent.landmark
    landmark_gradient = np.empty((s.n_landmarks, 3)) if spent is None else spent.landmark_gradient

    def accumulate(piece: tuple[int, int]) -> Array:
        pose = np.zeros((s.n_keyframes, visual.POSE_ENTRIES))
        visual.accumulate(
            state.p_W,
            state.X_W,
            R_CW,
            p_CB,
            problem.camera_arrays["intrinsics"],
            problem.obs_camera,
            problem.obs_uv,
            1.0 / problem.sigma_px,
            chain,
            s.pair_start,
            s.pair_keyframe,
            s.landmark_pair,
            piece[0],
            piece[1],
            pair,
            landmark,
            landmark_gradient,
            pose,
        )
        return pose

    pose = sum(workers.map(accumulate, s.pieces), np.zeros((s.n_keyframes, visual.POSE_ENTRIES)))
    visual.spread_poses(pose, chain, layout.column, layout.stride, storage, gradient)
    _add_inertial(problem, state, layout, chain, storage, gradient)
    return NormalEquations(s, storage, pair, landmark, gradient, landmark_gradient)


def _add_inertial(
    problem: Problem, state: State, layout: Layout, chain: Array, storage: Array, gradient: Array
) -> None:
    inertial_kernels.accumulate(
        *inertial_inputs(problem, state), chain, layout.column, layout.stride, storage, gradient
    )


def inertial_information(problem: Problem, state: State) -> Array:
    """(9N, 9N) share of the inertial factors in H; they do not see the landmarks."""
    layout = problem.structure.layout
    storage, gradient = np.zeros(layout.length), np.zeros((state.n_keyframes, 9))
    _add_inertial(problem, state, layout, first_rotation_chain(state), storage, gradient)
    return layout.dense(storage)
