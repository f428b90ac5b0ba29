"""How the motion block of H and the reduced camera system are stored: one lower triangle, dense or banded.

In a band, a keyframe's parameters, nine or with biases fifteen, stand together, and keyframes are ordered so
that those that share landmarks are near each other. In a dense triangle all velocities and biases come first,
then all poses, see :mod:`vigauge.kernels.chain`. An entry (r, c), r >= c, sits at
``storage[c * stride + r]`` in both forms (LAPACK's column order, full or band), so whoever fills it need not
know which one it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..errors import SolverError
from ..geometry.so3 import Array
from ..kernels import cholesky, covisibility, symmetric
from ..kernels.sizes import KEYFRAME, POSE, WITH_BIASES

Index = NDArray[np.int64]

NOT_POSITIVE_DEFINITE = "the reduced camera system is not positive definite"

# Below this many parameters a dense factorisation is never slower (measured).
SMALLEST_BAND = 180
# A band wider than this share of the matrix is factorised dense: LAPACK's full form has larger blocks.
WIDEST_BAND = 0.4

# Columns of each kind of three, position first, after the first column of its block.
_OF_KIND = 3 * np.arange(WITH_BIASES // 3)[:, None, None] + np.arange(3)


def motion_columns(n_keyframes: int, width: int = KEYFRAME) -> Index:
    """(N, 9) columns of (p_i, rotation_i, v_i) in the motion order of the package, (N, 15) with biases."""
    base = 3 * np.arange(n_keyframes)[:, None] + np.arange(3)
    return np.concatenate([base + 3 * n_keyframes * kind for kind in range(width // 3)], axis=1)


def by_keyframe(motion: Array, n_keyframes: int) -> Array:
    """(N, 9, ...) view per keyframe of motion quantities (9N, ...) in the package's order; 15 with biases."""
    rest = motion.shape[1:]
    blocks = motion.reshape(-1, n_keyframes, 3, *rest).swapaxes(0, 1)
    return blocks.reshape(n_keyframes, -1, *rest)


def _reach(place: Index, k: int, keyframe: Index, landmark: Index, first: Index, second: Index) -> int:
    """Largest distance in places between keyframes that share a landmark or a factor."""
    earliest, latest = np.empty((2, k), dtype=np.int64)
    shared = covisibility.spans(keyframe, landmark, place, earliest, latest)
    return max(shared, int(np.max(np.abs(place[first] - place[second]), initial=0)))


def _near_neighbours(
    n_keyframes: int, n_landmarks: int, keyframe: Index, landmark: Index, first: Index, second: Index
) -> Index:
    """(N,) places in reverse Cuthill-McKee order of the covisibility graph."""
    # Seldom needed, and a tenth of a second to import.
    import scipy.sparse
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    seen_by = scipy.sparse.coo_array(
        (np.ones(len(keyframe)), (landmark, keyframe)), (n_landmarks, n_keyframes)
    ).tocsr()
    factors = scipy.sparse.coo_array((np.ones(len(first)), (first, second)), (n_keyframes,) * 2).tocsr()
    graph = seen_by.T @ seen_by + factors
    order = reverse_cuthill_mckee((graph + graph.T).tocsr(), symmetric_mode=True)
    place = np.empty(n_keyframes, dtype=np.int64)
    place[order] = np.arange(n_keyframes)
    return place


@dataclass(frozen=True)
class Layout:
    """Places of keyframes in the stored triangle."""

    place: Index  # (N,) position of each keyframe in the stored order
    half_bandwidth: int  # largest r - c of an entry that may be filled
    banded: bool  # whether only the band is stored
    width: int = KEYFRAME  # parameters of a keyframe, 9 or 15

    @classmethod
    def choose(
        cls,
        n_keyframes: int,
        n_landmarks: int,
        keyframe: Index,
        landmark: Index,
        first: Index,
        second: Index,
        width: int = KEYFRAME,
    ) -> Layout:
        """Keyframes in their own order where that gives a band, else in reverse Cuthill-McKee, else dense.

        ``keyframe`` and ``landmark`` (M,) of every observation; ``first`` and ``second`` (F,) keyframes
        that an inertial or motion factor joins.
        """
        n = width * n_keyframes
        seen = n_landmarks, keyframe, landmark, first, second
        place = np.arange(n_keyframes, dtype=np.int64)
        if n < SMALLEST_BAND:
            return cls(place, n - 1, False, width)
        half_bandwidth = width * (_reach(place, *seen) + 1) - 1
        if half_bandwidth < WIDEST_BAND * n:
            return cls(place, half_bandwidth, True, width)
        place = _near_neighbours(n_keyframes, *seen)
        half_bandwidth = width * (_reach(place, *seen) + 1) - 1
        if half_bandwidth < WIDEST_BAND * n:
            return cls(place, half_bandwidth, True, width)
        return cls(np.arange(n_keyframes, dtype=np.int64), n - 1, False, width)

    @property
    def reordered(self) -> bool:
        """Whether keyframes were renumbered to make the band."""
        return not np.array_equal(self.place, np.arange(len(self.place)))

    @cached_property
    def size(self) -> int:
        """9N or 15N."""
        return self.width * len(self.place)

    @cached_property
    def stride(self) -> int:
        return self.half_bandwidth if self.banded else self.size

    @property
    def length(self) -> int:
        """Number of stored entries."""
        return self.size * (self.half_bandwidth + 1 if self.banded else self.size)

    @cached_property
    def pose(self) -> Index:
        """(N,) first stored column of each keyframe's pose."""
        if self.banded:
            return self.width * self.place
        return (self.width - POSE) * len(self.place) + POSE * self.place

    @cached_property
    def speed(self) -> Index:
        """(N,) first stored column of each keyframe's velocity, and of its biases, which follow."""
        return self.pose + POSE if self.banded else (self.width - POSE) * self.place

    @cached_property
    def first_rotation(self) -> int:
        """Stored column where the first keyframe's rotation begins."""
        return int(self.pose[0]) + 3

    @cached_property
    def columns(self) -> Index:
        """(N, width) columns of each keyframe in the package's order."""
        return motion_columns(len(self.place), self.width)

    @cached_property
    def stored(self) -> Index:
        """(9N,) stored column of each column of the package's order."""
        out = np.empty((self.width // 3, len(self.place), 3), dtype=np.int64)
        out[:2] = self.pose[:, None] + _OF_KIND[:2]
        out[2:] = self.speed[:, None] + _OF_KIND[: len(out) - 2]
        return out.ravel()

    def zeros(self, spent: Array | None = None) -> Array:
        """A triangle of zeros, in the memory of one that is no longer wanted, if any."""
        if spent is None:
            return np.zeros(self.length)
        symmetric.clear(spent, self.size, self.stride, self.half_bandwidth)
        return spent

    def copy(self, storage: Array) -> Array:
        """A copy of a triangle; what lies above it is left as memory has it."""
        out = np.empty(len(storage))
        symmetric.copy(storage, self.size, self.stride, self.half_bandwidth, out)
        return out

    def diagonal(self, storage: Array) -> Array:
        """(9N,) view of the diagonal, stored order."""
        return storage[:: self.stride + 1][: self.size]

    def require_near(self, at: Index) -> None:
        """SolverError where stored columns lie too far apart for the band to hold their products."""
        if self.banded and at.max() - at.min() > self.half_bandwidth:
            raise SolverError("a motion factor joins keyframes that are too far apart for the banded system")

    def hold(self, storage: Array, columns: Index) -> None:
        """Replace rows and columns by those of the identity, in place: what they stand for does not move."""
        symmetric.hold(storage, columns, self.stored, self.stride, self.half_bandwidth)

    def dense(self, storage: Array) -> Array:
        """(9N, 9N) symmetric matrix in the package's order."""
        n = self.size
        if self.banded:
            lower = np.zeros((n, n))
            for offset in range(self.half_bandwidth + 1):
                rows = np.arange(offset, n)
                lower[rows, rows - offset] = storage[(rows - offset) * self.stride + rows]
        else:
            lower = np.tril(storage.reshape(n, n).T)
        full = lower + np.tril(lower, -1).T
        return full[np.ix_(self.stored, self.stored)]

    def factorise(self, storage: Array) -> Factorised:
        """Cholesky factor of the stored matrix, which is overwritten.

        Raises SolverError where the matrix is not positive definite.
        """
        if not cholesky.factorise(storage, self.size, self.stride, self.half_bandwidth):
            raise SolverError(NOT_POSITIVE_DEFINITE)
        return Factorised(self, storage.reshape(self.size, -1).T)


@dataclass(frozen=True)
class Factorised:
    """Lower Cholesky factor in LAPACK's full or band form, stored order."""

    layout: Layout
    factor: Array

    def solve(self, right: Array) -> Array:
        """Solution for right-hand sides (9N, c), stored order."""
        columns, factor, layout = right.T.copy(), self.factor.T.ravel(), self.layout
        for column in columns:
            cholesky.solve(factor, layout.stride, layout.half_bandwidth, column)
        return columns.T
