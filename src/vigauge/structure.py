"""Which observations meet in one problem, and the order in which they are summed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .kernels import covisibility
from .kernels.visual import Unsigned
from .layout import Index, Layout

# What a group adds to the products of its landmarks, in multiplications (measured): neighbouring
# groups are joined while that saves work.
CALL_COST = 20_000.0

# Observations in a piece of a loop that may run on another core: a millisecond's work.
PIECE = 40_000


@dataclass(frozen=True)
class Structure:
    """Which observations meet: fixed for a problem, whatever the state.

    A group is made of landmarks that are first seen by neighbouring keyframes, and so by few
    keyframes in all: their W C^-1 W^T is one dense product over those. Landmarks, and with them
    the (landmark, keyframe) pairs, stand in the order of groups. Within a group observations
    stand by view, which is a camera at a keyframe; one view's are a run.

    Attributes
    ----------
    layout : storage of the motion block
    order : (K,) landmark at each place of that order
    group_landmark : (G + 1,) first place of each group
    landmark_pair : (K + 1,) first pair of the landmark at each place
    pair_keyframe : (P,) keyframe of each pair
    pair_row : (P,) place of that keyframe among those of the group
    group_seen, seen : (G + 1,) where each group's keyframes begin, and the keyframes
    group_run : (G + 1,) first run of each group
    run_start, run_view : (R + 1,) first observation of each run, (R,) keyframe * C + camera
    observation : (M,) number of each observation in the problem
    obs_landmark : (M,) landmark of each observation
    obs_pair : (M,) its pair q, or the complement ~q where one before has begun the pair
    """

    n_keyframes: int
    n_landmarks: int
    layout: Layout
    order: Index
    group_landmark: Index
    landmark_pair: Index
    pair_keyframe: Index
    pair_row: Index
    group_seen: Index
    seen: Index
    group_run: Index
    run_start: Index
    run_view: Index
    observation: Index
    obs_landmark: Unsigned
    obs_pair: Index

    @classmethod
    def of(
        cls,
        n: int,
        k: int,
        n_cameras: int,
        observed: tuple[Index, Index, Index],
        joined: tuple[Index, Index],
    ) -> Structure:
        """Of ``n`` keyframes and ``k`` landmarks.

        ``observed`` (M,) keyframe, camera and landmark of every observation, ordered by landmark, then
        keyframe; ``joined`` (F,) first and second keyframes of the inertial factors.
        """
        keyframe, camera, landmark = observed
        m = len(landmark)
        layout = Layout.choose(n, k, keyframe, landmark, *joined)
        first, last, number = (np.empty(size, dtype=np.int64) for size in (k, k, n))
        covisibility.spans(keyframe, landmark, layout.place, first, last)
        count = covisibility.join(first, last, n, CALL_COST, number)
        group_landmark, group_run, group_seen = np.empty((3, count + 1), dtype=np.int64)
        order, landmark_pair = np.empty(k, dtype=np.int64), np.empty(k + 1, dtype=np.int64)
        covisibility.order_landmarks(first, last, number, count, group_landmark, order)
        pair_keyframe, pair_row, observation, obs_pair = np.empty((4, m), dtype=np.int64)
        obs_landmark = np.empty(m, dtype=np.uint32)
        run_start, run_view, seen = np.empty((3, m + 1), dtype=np.int64)
        pairs, runs, width = covisibility.arrange(
            keyframe,
            camera,
            landmark,
            n,
            n_cameras,
            group_landmark,
            order,
            landmark_pair,
            pair_keyframe,
            pair_row,
            observation,
            obs_pair,
            obs_landmark,
            group_run,
            run_start,
            run_view,
            group_seen,
            seen,
        )
        return cls(
            n_keyframes=n,
            n_landmarks=k,
            layout=layout,
            order=order,
            group_landmark=group_landmark,
            landmark_pair=landmark_pair,
            pair_keyframe=pair_keyframe[:pairs],
            pair_row=pair_row[:pairs],
            group_seen=group_seen,
            seen=seen[:width],
            group_run=group_run,
            run_start=run_start[: runs + 1],
            run_view=run_view[:runs],
            observation=observation,
            obs_landmark=obs_landmark,
            obs_pair=obs_pair,
        )

    @property
    def n_groups(self) -> int:
        return len(self.group_landmark) - 1

    @cached_property
    def pair_landmark(self) -> Index:
        """(P,) landmark of each pair."""
        return np.repeat(self.order, np.diff(self.landmark_pair))

    @cached_property
    def rank(self) -> Index:
        """(K,) place of each landmark in the order of groups."""
        out = np.empty_like(self.order)
        out[self.order] = np.arange(self.n_landmarks)
        return out

    @cached_property
    def pieces(self) -> tuple[tuple[int, int], ...]:
        """Ranges of groups with about equally many observations each, whatever the number of cores."""
        total = len(self.observation)
        count = max(1, round(total / PIECE))
        if count == 1:
            return ((0, self.n_groups),) if self.n_groups else ()
        begins = self.run_start[self.group_run]
        ends = np.unique(np.searchsorted(begins, total * np.arange(1, count) / count))
        bounds = [0, *ends.tolist(), self.n_groups]
        return tuple((lo, hi) for lo, hi in zip(bounds[:-1], bounds[1:], strict=True) if lo < hi)

    def stored_by(self, piece: tuple[int, int]) -> slice:
        """Stored entries of the motion block that the groups of a piece have a share in lie in this range."""
        groups = slice(self.group_seen[piece[0]], self.group_seen[piece[1]])
        columns = self.layout.column[self.seen[groups]]
        low, high = int(columns.min()), int(columns.max()) + 8
        return slice(low * (self.layout.stride + 1), high * (self.layout.stride + 1) + 1)

    @property
    def columns(self) -> Index:
        """(N, 9) columns of each keyframe in the package's order."""
        return self.layout.columns
