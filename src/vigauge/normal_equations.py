"""The normal equations H dx = -g in blocks, and the elimination of the landmarks.

H = J^T J has three kinds of block: a dense one of the motion (9N x 9N), a 6 x 3 block a
(keyframe, landmark) pair, and a 3 x 3 block a landmark. The Schur complement onto the
motion, S = A - W C^-1 W^T (the reduced camera system), is all that is ever factorised.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from .errors import DegenerateError, SolverError
from .problem import Problem
from .residuals import InertialTerm, VisualTerm, inertial_term, visual_term
from .so3 import Array
from .state import State

Index = NDArray[np.int64]


def motion_columns(n_keyframes: int) -> Index:
    """(N, 9) columns of (p_i, rotation_i, v_i) in the motion order of the package."""
    base = 3 * np.arange(n_keyframes)[:, None] + np.arange(3)
    return np.concatenate([base, base + 3 * n_keyframes, base + 6 * n_keyframes], axis=1)


# Keyframes a group of landmarks may start in: wide groups waste products with zeros,
# narrow ones calls (measured at 10 and 30 keyframes).
GROUP_WIDTH = 6


@dataclass(frozen=True)
class CovisibleGroup:
    """Landmarks that are first seen by neighbouring keyframes, and so by few keyframes in all.

    Their W C^-1 W^T is one dense product over the keyframes that see any of them.
    ``pairs`` are the group's pairs; ``row`` and ``column`` their places among ``keyframes``
    and ``landmarks``.
    """

    keyframes: Index
    landmarks: Index
    pairs: Index
    row: Index
    column: Index


def _covisible_groups(
    pair_keyframe: Index, pair_landmark: Index, n_landmarks: int
) -> tuple[CovisibleGroup, ...]:
    if not n_landmarks:
        return ()
    # Pairs are ordered by landmark, then keyframe: the first pair names the first keyframe.
    first = pair_keyframe[np.searchsorted(pair_landmark, np.arange(n_landmarks))]
    bucket = (first // GROUP_WIDTH)[pair_landmark]
    groups = []
    for number in np.unique(bucket):
        pairs = np.flatnonzero(bucket == number)
        keyframes, row = np.unique(pair_keyframe[pairs], return_inverse=True)
        landmarks, column = np.unique(pair_landmark[pairs], return_inverse=True)
        groups.append(CovisibleGroup(keyframes, landmarks, pairs, row, column))
    return tuple(groups)


@dataclass(frozen=True)
class Structure:
    """Which observations meet: fixed for a problem, whatever the state.

    Attributes
    ----------
    pair_start : (P,) first observation of each (landmark, keyframe) pair
    pair_keyframe, pair_landmark : (P,) what the pair joins, ordered by landmark
    landmark_start : (K,) first observation of each landmark
    by_keyframe, keyframe_start : order of observations by keyframe, and first of each
    observed : (N',) keyframes that have observations
    """

    n_keyframes: int
    n_landmarks: int
    pair_start: Index
    pair_keyframe: Index
    pair_landmark: Index
    landmark_start: Index
    by_keyframe: Index
    keyframe_start: Index
    observed: Index

    @classmethod
    def of(cls, problem: Problem) -> Structure:
        keyframe, landmark = problem.obs_keyframe, problem.obs_landmark
        # A change of either index starts a new pair; runs are contiguous (problem order).
        change = np.ones(len(landmark), dtype=bool)
        change[1:] = (np.diff(landmark) != 0) | (np.diff(keyframe) != 0)
        pair_start = np.flatnonzero(change)
        by_keyframe = np.argsort(keyframe, kind="stable")
        observed, keyframe_start = np.unique(keyframe[by_keyframe], return_index=True)
        return cls(
            n_keyframes=problem.initial.n_keyframes,
            n_landmarks=problem.initial.n_landmarks,
            pair_start=pair_start,
            pair_keyframe=keyframe[pair_start],
            pair_landmark=landmark[pair_start],
            landmark_start=np.searchsorted(landmark, np.arange(problem.initial.n_landmarks)),
            by_keyframe=by_keyframe,
            keyframe_start=keyframe_start,
            observed=observed,
        )

    @cached_property
    def groups(self) -> tuple[CovisibleGroup, ...]:
        return _covisible_groups(self.pair_keyframe, self.pair_landmark, self.n_landmarks)

    @cached_property
    def columns(self) -> Index:
        return motion_columns(self.n_keyframes)


@dataclass(frozen=True)
class NormalEquations:
    """H and g of one linearisation point.

    Attributes
    ----------
    motion : (9N, 9N) block A
    pair : (P, 6, 3) blocks W of (position and rotation, landmark)
    landmark : (K, 3, 3) blocks C
    motion_gradient, landmark_gradient : (9N,) and (K, 3) parts of g = J^T r
    """

    structure: Structure
    motion: Array
    pair: Array
    landmark: Array
    motion_gradient: Array
    landmark_gradient: Array

    @property
    def gradient(self) -> Array:
        """(9N + 3K,) g = J^T r."""
        return np.concatenate([self.motion_gradient, self.landmark_gradient.ravel()])

    def diagonal(self) -> Array:
        """(9N + 3K,) diagonal of H."""
        landmark = np.diagonal(self.landmark, axis1=1, axis2=2)
        return np.concatenate([np.diagonal(self.motion), landmark.ravel()])

    def with_prior(self, columns: Index, residual: Array, jacobian: Array) -> NormalEquations:
        """Add a whitened residual that depends on the motion parameters ``columns`` only."""
        motion, gradient = self.motion.copy(), self.motion_gradient.copy()
        motion[np.ix_(columns, columns)] += jacobian.T @ jacobian
        gradient[columns] += jacobian.T @ residual
        return replace(self, motion=motion, motion_gradient=gradient)

    def eliminate(self, damping: Array | None = None) -> ReducedSystem:
        """Schur complement onto the motion of H + diag(damping); damping is (9N + 3K,).

        Raises SolverError where a landmark block is not positive definite, and without damping
        DegenerateError where one is singular to rounding: a landmark seen along one line only.
        """
        s = self.structure
        n_motion = 9 * s.n_keyframes
        motion, landmark = self.motion, self.landmark
        if damping is not None:
            motion = motion + np.diag(damping[:n_motion])
            landmark = landmark.copy()
            diagonal = np.arange(3)
            landmark[:, diagonal, diagonal] += damping[n_motion:].reshape(-1, 3)
        try:
            # F with F^T F = C^-1, so that W C^-1 W^T = (W F^T)(W F^T)^T.
            root = np.linalg.cholesky(landmark)
        except np.linalg.LinAlgError as error:
            raise SolverError("a landmark's block of H is not positive definite") from error
        if damping is None:
            _require_full_rank(landmark, root)
        factor = np.linalg.inv(root)
        half = self.pair @ factor[s.pair_landmark].swapaxes(1, 2)
        half_gradient = np.einsum("kij,kj->ki", factor, self.landmark_gradient)
        reduced, gradient = motion.copy(), self.motion_gradient.copy()
        for group in s.groups:
            blocks = np.zeros((len(group.keyframes), 6, len(group.landmarks), 3))
            blocks[group.row, :, group.column] = half[group.pairs]
            spread = blocks.reshape(len(group.keyframes) * 6, -1)
            pose = s.columns[group.keyframes, :6].ravel()
            reduced[np.ix_(pose, pose)] -= spread @ spread.T
            gradient[pose] -= spread @ half_gradient[group.landmarks].ravel()
        return ReducedSystem(s, reduced, gradient, half, factor, half_gradient)

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

    ``matrix`` (9N, 9N) S; ``gradient`` (9N,) b; ``half`` (P, 6, 3) W F^T; ``factor``
    (K, 3, 3) F with F^T F = C^-1; ``half_gradient`` (K, 3) F g_landmark.
    """

    structure: Structure
    matrix: Array
    gradient: Array
    half: Array
    factor: Array
    half_gradient: Array

    def solve(self, held: Index) -> Array:
        """The full step (9N + 3K,), zero in the ``held`` motion columns.

        Raises SolverError where the reduced system is not positive definite.
        """
        keep = np.ones(len(self.gradient), dtype=bool)
        keep[held] = False
        matrix = self.matrix if not len(held) else self.matrix[np.ix_(keep, keep)]
        try:
            factorised = scipy.linalg.cho_factor(matrix, lower=True, check_finite=False)
        except np.linalg.LinAlgError as error:
            raise SolverError("the reduced camera system is not positive definite") from error
        motion = np.zeros(len(self.gradient))
        motion[keep] = scipy.linalg.cho_solve(factorised, -self.gradient[keep], check_finite=False)
        return np.concatenate([motion, self.back_substitute(motion).ravel()])

    def coupling(self, motion: Array) -> Array:
        """F W^T x of motion vectors x (9N, ...): shape (K, 3, ...)."""
        s = self.structure
        pose = motion[s.columns[:, :6]]  # (N, 6, ...)
        product = np.einsum("pij,pi...->pj...", self.half, pose[s.pair_keyframe])
        return np.add.reduceat(product, np.searchsorted(s.pair_landmark, np.arange(s.n_landmarks)), axis=0)

    def couple_back(self, landmark: Array) -> Array:
        """W F^T y of landmark quantities y (K, 3, c): shape (9N, c), zero for velocities."""
        s = self.structure
        out = np.zeros((len(self.gradient),) + landmark.shape[2:])
        np.add.at(out, s.columns[s.pair_keyframe, :6], self.half @ landmark[s.pair_landmark])
        return out

    def back_substitute(self, motion: Array) -> Array:
        """(K, 3) landmark steps that go with a motion step (9N,)."""
        right = -self.half_gradient
        if self.structure.n_landmarks:
            right = right - self.coupling(motion)
        return np.einsum("kji,kj->ki", self.factor, right)


def _require_full_rank(landmark: Array, root: Array) -> None:
    """A pivot that is a rounding error of its diagonal entry means a direction that no view measures."""
    diagonal = np.diagonal(landmark, axis1=1, axis2=2)
    pivot = np.diagonal(root, axis1=1, axis2=2) ** 2
    smallest = np.min(pivot / diagonal, axis=1, initial=1.0)
    if np.any(smallest < 1e3 * np.finfo(float).eps):
        raise DegenerateError(f"landmark {int(np.argmin(smallest))} is unobservable along its line of sight")


def _sum_runs(blocks: Array, starts: Index) -> Array:
    return np.add.reduceat(blocks, starts, axis=0) if len(starts) else blocks[:0]


def _add_visual(s: Structure, term: VisualTerm, motion: Array, gradient: Array) -> None:
    ordered = term.by_pose[s.by_keyframe]
    residual = term.residual[s.by_keyframe]
    ends = np.append(s.keyframe_start, len(ordered))[1:]
    # One BLAS product a keyframe, not one small product an observation.
    for keyframe, lo, hi in zip(s.observed, s.keyframe_start, ends, strict=True):
        J = ordered[lo:hi].reshape(-1, 6)
        columns = s.columns[keyframe, :6]
        motion[np.ix_(columns, columns)] += J.T @ J
        gradient[columns] += J.T @ residual[lo:hi].ravel()


def _add_inertial(problem: Problem, s: Structure, term: InertialTerm, motion: Array, gradient: Array) -> None:
    f = problem.inertial
    J = np.concatenate([term.by_first, term.by_second], axis=2)
    columns = np.concatenate([s.columns[f.first], s.columns[f.second]], axis=1)
    J_T = J.swapaxes(1, 2)
    np.add.at(motion, (columns[:, :, None], columns[:, None, :]), J_T @ J)
    np.add.at(gradient, columns, (J_T @ term.residual[:, :, None])[:, :, 0])


def assemble(
    structure: Structure, problem: Problem, visual: VisualTerm, inertial: InertialTerm
) -> NormalEquations:
    """H and g from the linearised terms."""
    n_motion = 9 * structure.n_keyframes
    motion, gradient = np.zeros((n_motion, n_motion)), np.zeros(n_motion)
    _add_visual(structure, visual, motion, gradient)
    _add_inertial(problem, structure, inertial, motion, gradient)
    J_l_T = visual.by_landmark.swapaxes(1, 2)
    pair = _sum_runs(visual.by_pose.swapaxes(1, 2) @ visual.by_landmark, structure.pair_start)
    landmark = _sum_runs(J_l_T @ visual.by_landmark, structure.landmark_start)
    landmark_gradient = _sum_runs((J_l_T @ visual.residual[:, :, None])[:, :, 0], structure.landmark_start)
    return NormalEquations(structure, motion, pair, landmark, gradient, landmark_gradient)


def inertial_information(problem: Problem, state: State) -> Array:
    """(9N, 9N) share of the inertial factors in H; they do not see the landmarks."""
    structure = Structure.of(problem)
    n_motion = 9 * structure.n_keyframes
    information = np.zeros((n_motion, n_motion))
    _add_inertial(problem, structure, inertial_term(problem, state), information, np.zeros(n_motion))
    return information


def linearise(problem: Problem, state: State) -> NormalEquations:
    """H = J^T J and g = J^T r of Eq. (1) at a state, without any gauge."""
    structure = Structure.of(problem)
    return assemble(structure, problem, visual_term(problem, state), inertial_term(problem, state))
