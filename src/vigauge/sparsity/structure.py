"""Which observations meet in one problem, and the order in which they are summed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..kernels import covisibility
from ..kernels.lanes import LANES, Batches
from ..kernels.sizes import KEYFRAME, POSE
from .layout import Index, Layout

# What a group costs besides the products of its landmarks, and each entry of its product, in
# multiplications (measured): neighbouring groups are joined while that saves work.
CALL_COST = 20_000.0
ENTRY_COST = 20.0

# Observations, empty lanes too, in a piece of a loop that may run on another core: half a millisecond's work.
PIECE = 40_000


@dataclass(frozen=True)
class Pairs:
    """The P pairs of a landmark and a keyframe that sees it, in the problem's order.

    ``landmark``, ``keyframe`` (P,); ``begin`` (K + 1,) first pair of each landmark; ``cell`` and
    ``lane`` (P,) where the kernels keep the pair.
    """

    landmark: Index
    keyframe: Index
    begin: Index
    cell: Index
    lane: Index


@dataclass(frozen=True)
class Structure:
    """Which observations meet: fixed for a problem, whatever the state.

    A group is made of landmarks that are first seen by neighbouring keyframes, and so by few
    keyframes in all: their W C^-1 W^T is one dense product over those. Its landmarks are taken in
    batches, side by side.
    """

    n_keyframes: int
    n_landmarks: int
    layout: Layout  # storage of the motion block
    batches: Batches  # who sees what, as the kernels run through it
    group_batch: Index  # (G + 1,) first batch of each group
    # (G + 1,) where each group's keyframes begin, and the keyframes.
    group_seen: Index
    seen: Index
    obs_slot: Index  # (M,) view * LANES + lane of each observation of the problem
    obs_keyframe: Index
    obs_landmark: Index

    @classmethod
    def of(
        cls,
        n: int,
        k: int,
        n_cameras: int,
        observed: tuple[Index, Index, Index],
        joined: tuple[Index, Index],
        width: int = KEYFRAME,
    ) -> Structure:
        """Of ``n`` keyframes, ``width`` parameters each, and ``k`` landmarks.

        ``observed`` (M,) keyframe, camera and landmark of every observation, ordered by landmark, then
        keyframe; ``joined`` (F,) first and second keyframes that a factor joins.
        """
        keyframe, camera, landmark = observed
        m = len(landmark)
        layout = Layout.choose(n, k, keyframe, landmark, *joined, width)
        first, last, number = (np.empty(size, dtype=np.int64) for size in (k, k, n))
        covisibility.spans(keyframe, landmark, layout.place, first, last)
        count = covisibility.join(first, last, n, CALL_COST, ENTRY_COST, number)
        group_landmark, group_batch, group_seen = np.empty((3, count + 1), dtype=np.int64)
        order, begin = np.empty(k, dtype=np.int64), np.empty(k + 1, dtype=np.int64)
        covisibility.order_landmarks(landmark, keyframe, first, last, number, count, group_landmark, order)
        n_batches = covisibility.begin_batches(group_landmark, group_batch, begin)
        batch_cell = np.empty(n_batches + 1, dtype=np.int64)
        cell_keyframe, cell_row, view_camera, obs_slot, seen = np.empty((5, m), dtype=np.int64)
        cell_view = np.empty(m + 1, dtype=np.int64)
        found = Batches(
            order, begin[: n_batches + 1], batch_cell, cell_keyframe, cell_row, cell_view, view_camera
        )
        cells, views, width = covisibility.arrange(
            keyframe, camera, landmark, n, n_cameras, group_batch, found, obs_slot, group_seen, seen
        )
        return cls(
            n_keyframes=n,
            n_landmarks=k,
            layout=layout,
            batches=found._replace(
                cell_keyframe=cell_keyframe[:cells],
                cell_row=cell_row[:cells],
                cell_view=cell_view[: cells + 1],
                view_camera=view_camera[:views],
            ),
            group_batch=group_batch,
            group_seen=group_seen,
            seen=seen[:width],
            obs_slot=obs_slot,
            obs_keyframe=keyframe,
            obs_landmark=landmark,
        )

    @property
    def n_groups(self) -> int:
        return len(self.group_batch) - 1

    @property
    def n_batches(self) -> int:
        return len(self.batches.batch_begin) - 1

    @property
    def n_cells(self) -> int:
        return len(self.batches.cell_keyframe)

    @property
    def n_views(self) -> int:
        return len(self.batches.view_camera)

    @cached_property
    def pairs(self) -> Pairs:
        """The pairs, for whatever is no sum over observations."""
        starts = np.ones(len(self.obs_slot), dtype=bool)
        starts[1:] = (np.diff(self.obs_landmark) != 0) | (np.diff(self.obs_keyframe) != 0)
        landmark, slot = self.obs_landmark[starts], self.obs_slot[starts]
        view_cell = np.repeat(np.arange(self.n_cells), np.diff(self.batches.cell_view))
        return Pairs(
            landmark=landmark,
            keyframe=self.obs_keyframe[starts],
            begin=np.searchsorted(landmark, np.arange(self.n_landmarks + 1)),
            cell=view_cell[slot // LANES],
            lane=slot % LANES,
        )

    @cached_property
    def landmark_lane(self) -> tuple[Index, Index]:
        """(K,) batch and lane of each landmark."""
        batches = self.batches
        place = np.empty_like(batches.order)
        place[batches.order] = np.arange(self.n_landmarks)
        batch = np.searchsorted(batches.batch_begin, place, side="right") - 1
        return batch, place - batches.batch_begin[batch]

    @cached_property
    def pieces(self) -> tuple[tuple[int, int], ...]:
        """Ranges of groups with about equally much work each, whatever the number of cores."""
        total = self.n_views * LANES
        count = max(1, round(total / PIECE))
        if count == 1:
            return ((0, self.n_groups),) if self.n_groups else ()
        begins = LANES * self.batches.cell_view[self.batches.batch_cell[self.group_batch]]
        ends = np.unique(np.searchsorted(begins, total * np.arange(1, count) / count))
        bounds = [0, *ends.tolist(), self.n_groups]
        return tuple((lo, hi) for lo, hi in zip(bounds[:-1], bounds[1:], strict=True) if lo < hi)

    def stored_by(self, piece: tuple[int, int]) -> slice:
        """Stored entries of the motion block that the groups of a piece have a share in lie in this range."""
        groups = slice(self.group_seen[piece[0]], self.group_seen[piece[1]])
        columns = self.layout.pose[self.seen[groups]]
        low, high = int(columns.min()), int(columns.max()) + POSE - 1
        return slice(low * (self.layout.stride + 1), high * (self.layout.stride + 1) + 1)

    @property
    def columns(self) -> Index:
        """(N, width) columns of each keyframe in the package's order."""
        return self.layout.columns
