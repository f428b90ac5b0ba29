"""Which observations meet in one problem: pairs, groups for the elimination, storage of the motion block."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .layout import Index, Layout

# Products of a group are made by one call of BLAS, which costs as much as this many
# multiplications (measured): neighbouring groups are joined while that saves calls.
CALL_COST = 100_000.0

# Observations in a piece of a loop that may run on another core: a millisecond's work.
PIECE = 40_000


@dataclass(frozen=True)
class CovisibleGroup:
    """Landmarks that are first seen by neighbouring keyframes, and so by few keyframes in all.

    Their W C^-1 W^T is one dense product over the ``keyframes`` that see any of them.
    """

    keyframes: Index
    landmarks: Index


@dataclass(frozen=True)
class Structure:
    """Which observations meet: fixed for a problem, whatever the state.

    Attributes
    ----------
    pair_start : (P + 1,) first observation of each (landmark, keyframe) pair
    pair_keyframe, pair_landmark : (P,) what the pair joins, ordered by landmark
    landmark_pair : (K + 1,) first pair of each landmark
    layout : storage of the motion block
    """

    n_keyframes: int
    n_landmarks: int
    pair_start: Index
    pair_keyframe: Index
    pair_landmark: Index
    landmark_pair: Index
    layout: Layout

    @classmethod
    def of(cls, n: int, k: int, keyframe: Index, landmark: Index, joined: tuple[Index, Index]) -> Structure:
        """From the keyframe and landmark of every observation, ordered by landmark, then keyframe.

        ``n`` keyframes, ``k`` landmarks; ``joined`` (F,) first and second keyframes of the inertial factors.
        """
        # A change of either index starts a new pair; runs are contiguous (problem order).
        change = np.ones(len(landmark) + 1, dtype=bool)
        change[1:-1] = (landmark[1:] != landmark[:-1]) | (keyframe[1:] != keyframe[:-1])
        pair_start = np.flatnonzero(change)
        pair_keyframe = keyframe[pair_start[:-1]]
        pair_landmark = landmark[pair_start[:-1]]
        landmark_pair = np.searchsorted(pair_landmark, np.arange(k + 1))
        return cls(
            n_keyframes=n,
            n_landmarks=k,
            pair_start=pair_start,
            pair_keyframe=pair_keyframe,
            pair_landmark=pair_landmark,
            landmark_pair=landmark_pair,
            layout=Layout.choose(n, pair_keyframe, landmark_pair, *joined),
        )

    @cached_property
    def groups(self) -> tuple[CovisibleGroup, ...]:
        return self._grouped[0]

    @cached_property
    def pair_row(self) -> Index:
        """(P,) place of each pair's keyframe among the keyframes of its landmark's group."""
        return self._grouped[1]

    @cached_property
    def _grouped(self) -> tuple[tuple[CovisibleGroup, ...], Index]:
        if not self.n_landmarks:
            return (), np.zeros(0, dtype=np.int64)
        place = self.layout.place[self.pair_keyframe]
        first = np.minimum.reduceat(place, self.landmark_pair[:-1])
        last = np.maximum.reduceat(place, self.landmark_pair[:-1])
        bucket = _joined_buckets(first, last, self.n_keyframes)[first]
        by_bucket = np.argsort(bucket, kind="stable")
        pair_bucket = bucket[self.pair_landmark]
        pairs_by_bucket = np.argsort(pair_bucket, kind="stable")
        numbers = np.unique(bucket)
        ends = np.searchsorted(bucket[by_bucket], numbers, side="right")
        pair_ends = np.searchsorted(pair_bucket[pairs_by_bucket], numbers, side="right")
        groups, pair_row = [], np.empty(len(place), dtype=np.int64)
        row = np.empty(self.n_keyframes, dtype=np.int64)
        lo, pair_lo = 0, 0
        for hi, pair_hi in zip(ends, pair_ends, strict=True):
            pairs = pairs_by_bucket[pair_lo:pair_hi]
            keyframe = self.pair_keyframe[pairs]
            seen = np.flatnonzero(np.bincount(keyframe))
            row[seen] = np.arange(len(seen))
            pair_row[pairs] = row[keyframe]
            groups.append(CovisibleGroup(seen, by_bucket[lo:hi]))
            lo, pair_lo = hi, pair_hi
        return tuple(groups), pair_row

    @cached_property
    def pieces(self) -> tuple[tuple[int, int], ...]:
        """Ranges of landmarks with about equally many observations each, whatever the number of cores."""
        total = int(self.pair_start[-1])
        count = max(1, round(total / PIECE))
        ends = np.searchsorted(self.pair_start[self.landmark_pair], total * np.arange(1, count) / count)
        bounds = [0, *ends.tolist(), self.n_landmarks]
        return tuple(zip(bounds[:-1], bounds[1:], strict=True))

    @property
    def columns(self) -> Index:
        """(N, 9) columns of each keyframe in the package's order."""
        return self.layout.columns


def _joined_buckets(first: Index, last: Index, n_places: int) -> Index:
    """(N,) group number of landmarks first seen at each place: neighbours share one where that is cheaper.

    A group's cost is one call plus the products over the places between its first and last.
    """
    count = np.bincount(first, minlength=n_places)
    end = np.zeros(n_places, dtype=np.int64)
    np.maximum.at(end, first, last)
    number = np.zeros(n_places, dtype=np.int64)
    current, begin, landmarks, reach, cost = -1, 0, 0, 0, np.inf
    for place in range(n_places):
        if count[place]:
            alone = CALL_COST + 3.0 * count[place] * (6.0 * (end[place] - place + 1)) ** 2
            wide = max(reach, int(end[place]))
            joint = CALL_COST + 3.0 * (landmarks + count[place]) * (6.0 * (wide - begin + 1)) ** 2
            if current >= 0 and joint <= cost + alone:
                landmarks, reach, cost = landmarks + count[place], wide, joint
            else:
                current += 1
                begin, landmarks, reach, cost = place, count[place], int(end[place]), alone
        number[place] = current
    return number
