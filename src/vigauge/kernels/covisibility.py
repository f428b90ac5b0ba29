"""Which keyframes see which landmarks, and the order in which the sums over observations run."""

from __future__ import annotations

import numpy as np

from ..geometry.so3 import Array
from .compiled import kernel, part
from .lanes import LANES, Batches, Index

# A track has long gaps where its last place is at least that times its keyframes behind its first; a
# batch has them where its columns reach further than that times as many as it fills.
LONG_GAPS = 1.5


@kernel
def spans(keyframe: Index, landmark: Index, place: Index, first: Index, last: Index) -> int:
    """First and last place (K,) from which each landmark is seen; the longest distance between them."""
    first[:] = len(place)
    last[:] = 0
    for m in range(len(landmark)):
        j, at = landmark[m], place[keyframe[m]]
        first[j] = min(first[j], at)
        last[j] = max(last[j], at)
    reach = 0
    for j in range(len(first)):
        reach = max(reach, last[j] - first[j])
    return reach


@kernel
def join(first: Index, last: Index, n_places: int, call_cost: float, entry_cost: float, number: Index) -> int:
    """Group number (N,) of landmarks first seen at each place; how many groups there are.

    A group costs a call, its product's entries, and the empty lanes of its last batch; neighbours
    share one where that is cheaper. What its batches' own products cost hardly depends on the group:
    tracks with long gaps stand apart (:func:`order_landmarks`).
    """
    count = np.zeros(n_places, dtype=np.int64)
    end = np.zeros(n_places, dtype=np.int64)
    for j in range(len(first)):
        count[first[j]] += 1
        end[first[j]] = max(end[first[j]], last[j])
    current, begin, landmarks, reach = -1, 0, 0, 0
    cost = 0.0
    for place in range(n_places):
        if count[place]:
            alone = _group_cost(count[place], end[place] - place + 1, call_cost, entry_cost)
            wide = max(reach, end[place])
            joint = _group_cost(landmarks + count[place], wide - begin + 1, call_cost, entry_cost)
            if current >= 0 and joint <= cost + alone:
                landmarks, reach, cost = landmarks + count[place], wide, joint
            else:
                current += 1
                begin, landmarks, reach, cost = place, count[place], end[place], alone
        number[place] = current
    return current + 1


@part
def _group_cost(count: int, places: int, call_cost: float, entry_cost: float) -> float:
    """In multiplications, of which an empty lane takes as many as a landmark."""
    entries = (6.0 * places) ** 2
    return call_cost + entry_cost * entries + 3.0 * (-count % LANES) * entries


@kernel
def order_landmarks(
    landmark: Index,
    keyframe: Index,
    first: Index,
    last: Index,
    number: Index,
    n_groups: int,
    group_landmark: Index,
    order: Index,
) -> None:
    """Landmarks by group, first place and last, ``order`` (K,); where groups begin, ``group_landmark``.

    Within a group, tracks with long gaps come last, by their last place only: where a flight comes back
    to a place, they share batches, and are in none of those that need not reach so far.
    """
    n = len(number)
    views = np.zeros(len(order), dtype=np.int64)
    for m in range(len(landmark)):
        if m == 0 or landmark[m] != landmark[m - 1] or keyframe[m] != keyframe[m - 1]:
            views[landmark[m]] += 1
    group, begin, source = np.empty_like(order), np.empty_like(order), np.arange(len(order))
    for j in range(len(first)):
        group[j] = number[first[j]]
        begin[j] = first[j] if last[j] - first[j] < LONG_GAPS * views[j] else n
    _sort_by(last, n, source, order)
    _sort_by(begin, n + 1, order, source)
    _sort_by(group, n_groups, source, order)
    group_landmark[:] = 0
    for j in range(len(first)):
        group_landmark[group[j] + 1] += 1
    for g in range(n_groups):
        group_landmark[g + 1] += group_landmark[g]


@kernel
def _sort_by(key: Index, n: int, source: Index, target: Index) -> None:
    """``source`` ordered by a key from 0 to n - 1; what is equal stays in its order (a counting sort)."""
    at = np.zeros(n + 1, dtype=np.int64)
    for j in source:
        at[key[j] + 1] += 1
    for i in range(n):
        at[i + 1] += at[i]
    for j in source:
        target[at[key[j]]] = j
        at[key[j]] += 1


@part
def begin_batches(group_landmark: Index, group_batch: Index, begin: Index) -> int:
    """Batches within groups: first of each group, first place of each batch; how many there are."""
    count = 0
    for g in range(len(group_landmark) - 1):
        group_batch[g] = count
        for place in range(group_landmark[g], group_landmark[g + 1], LANES):
            begin[count] = place
            count += 1
    group_batch[len(group_landmark) - 1] = count
    begin[count] = group_landmark[len(group_landmark) - 1]
    return count


@kernel
def arrange(
    keyframe: Index,
    camera: Index,
    landmark: Index,
    n_keyframes: int,
    n_cameras: int,
    group_batch: Index,
    batches: Batches,
    obs_slot: Index,
    group_seen: Index,
    seen: Index,
) -> tuple[int, int, int]:
    """Fill the arrays of :class:`vigauge.sparsity.structure.Structure`.

    Returns how many cells, views and entries of ``seen`` there are.

    Observations come ordered by landmark, then keyframe. A camera sees a landmark once from a keyframe.
    """
    order, batch_begin, batch_cell, cell_keyframe, cell_row, cell_view, view_camera = batches
    n_landmarks = len(order)
    start = np.zeros(n_landmarks + 1, dtype=np.int64)
    for m in range(len(landmark)):
        start[landmark[m] + 1] += 1
    for j in range(n_landmarks):
        start[j + 1] += start[j]
    # Of a camera at a keyframe: whether the batch needs it, and its view.
    needed = np.zeros(n_keyframes * n_cameras, dtype=np.bool_)
    view = np.empty(n_keyframes * n_cameras, dtype=np.int64)
    touched = np.empty(n_keyframes * n_cameras, dtype=np.int64)
    row = np.full(n_keyframes, -1)
    cells, views, width = 0, 0, 0
    for g in range(len(group_batch) - 1):
        group_seen[g] = width
        first_cell = cells
        for b in range(group_batch[g], group_batch[g + 1]):
            count = 0
            for place in range(batch_begin[b], batch_begin[b + 1]):
                j = order[place]
                for m in range(start[j], start[j + 1]):
                    at = keyframe[m] * n_cameras + camera[m]
                    if not needed[at]:
                        needed[at] = True
                        touched[count] = at
                        count += 1
            touched[:count].sort()
            batch_cell[b] = cells
            previous = -1
            for at in touched[:count]:
                k = at // n_cameras
                if k != previous:
                    previous = k
                    cell_keyframe[cells], cell_view[cells] = k, views
                    cells += 1
                    if row[k] < 0:
                        row[k] = 0
                        seen[width] = k
                        width += 1
                view[at] = views
                view_camera[views] = at % n_cameras
                views += 1
                needed[at] = False
            for place in range(batch_begin[b], batch_begin[b + 1]):
                j = order[place]
                for m in range(start[j], start[j + 1]):
                    at = keyframe[m] * n_cameras + camera[m]
                    obs_slot[m] = view[at] * LANES + place - batch_begin[b]
        of_group = seen[group_seen[g] : width]
        of_group.sort()
        for i in range(len(of_group)):
            row[of_group[i]] = i
        for cell in range(first_cell, cells):
            cell_row[cell] = row[cell_keyframe[cell]]
        row[of_group] = -1
    batch_cell[group_batch[len(group_batch) - 1]] = cells
    cell_view[cells] = views
    group_seen[len(group_batch) - 1] = width
    return cells, views, width


@part
def spread_pixels(uv: Array, weight: Array, obs_slot: Index, out: Array) -> None:
    """Pixels (M, 2) and their weights (M,) to the lanes of their views: zeroed ``out`` (V, 3 LANES)."""
    for m in range(len(obs_slot)):
        view, lane = obs_slot[m] // LANES, obs_slot[m] % LANES
        out[view, lane], out[view, LANES + lane], out[view, 2 * LANES + lane] = uv[m, 0], uv[m, 1], weight[m]
