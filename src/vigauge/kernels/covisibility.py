"""Which keyframes see which landmarks, and the order in which the sums over observations run."""

from __future__ import annotations

import numpy as np

from ..so3 import Array
from .compiled import kernel
from .visual import Index, Unsigned


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
def join(first: Index, last: Index, n_places: int, call_cost: float, number: Index) -> int:
    """Group number (N,) of landmarks first seen at each place; how many groups there are.

    A group's cost is one call plus the products over the places between its first and last;
    neighbours share a group where that is cheaper.
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
            alone = call_cost + 3.0 * count[place] * (6.0 * (end[place] - place + 1)) ** 2
            wide = max(reach, end[place])
            joint = call_cost + 3.0 * (landmarks + count[place]) * (6.0 * (wide - begin + 1)) ** 2
            if current >= 0 and joint <= cost + alone:
                landmarks, reach, cost = landmarks + count[place], wide, joint
            else:
                current += 1
                begin, landmarks, reach, cost = place, count[place], end[place], alone
        number[place] = current
    return current + 1


@kernel
def order_landmarks(
    first: Index, last: Index, number: Index, n_groups: int, group_landmark: Index, order: Index
) -> None:
    """Landmarks by first place, then by last, ``order`` (K,); ``group_landmark`` (G + 1,) where groups begin.

    Two passes of a counting sort; what is equal stays in the problem's order.
    """
    order[:] = np.arange(len(order))
    by_last = np.empty_like(order)
    for key, source, target in ((last, order, by_last), (first, by_last, order)):
        at = np.zeros(len(number) + 1, dtype=np.int64)
        for j in range(len(key)):
            at[key[j] + 1] += 1
        for n in range(len(number)):
            at[n + 1] += at[n]
        for j in source:
            target[at[key[j]]] = j
            at[key[j]] += 1
    group_landmark[:] = 0
    for j in range(len(first)):
        group_landmark[number[first[j]] + 1] += 1
    for g in range(n_groups):
        group_landmark[g + 1] += group_landmark[g]


@kernel
def arrange(
    keyframe: Index,
    camera: Index,
    landmark: Index,
    n_keyframes: int,
    n_cameras: int,
    group_landmark: Index,
    order: Index,
    landmark_pair: Index,
    pair_keyframe: Index,
    pair_row: Index,
    observation: Index,
    obs_pair: Index,
    obs_landmark: Unsigned,
    group_run: Index,
    run_start: Index,
    run_view: Index,
    group_seen: Index,
    seen: Index,
) -> tuple[int, int, int]:
    """Fill the arrays of :class:`vigauge.structure.Structure`; how many pairs, runs and ``seen`` there are.

    Observations come ordered by landmark, then keyframe. Those of a group are ordered anew by
    view, which is a camera at a keyframe: a run has one view.
    """
    begin = np.zeros(len(order) + 1, dtype=np.int64)
    for m in range(len(landmark)):
        begin[landmark[m] + 1] += 1
    for j in range(len(order)):
        begin[j + 1] += begin[j]
    at = np.zeros(n_keyframes * n_cameras, dtype=np.int64)
    row = np.zeros(n_keyframes, dtype=np.int64)
    views = np.empty(n_keyframes * n_cameras, dtype=np.int64)
    pairs, runs, width, taken = 0, 0, 0, 0
    landmark_pair[0] = 0
    group_run[0] = 0
    group_seen[0] = 0
    for g in range(len(group_landmark) - 1):
        touched = 0
        for place in range(group_landmark[g], group_landmark[g + 1]):
            j = order[place]
            for m in range(begin[j], begin[j + 1]):
                view = keyframe[m] * n_cameras + camera[m]
                if at[view] == 0:
                    views[touched] = view
                    touched += 1
                at[view] += 1
        views[:touched].sort()
        previous = -1
        for n in range(touched):
            view = views[n]
            run_start[runs] = taken
            run_view[runs] = view
            runs += 1
            count = at[view]
            at[view] = taken
            taken += count
            if view // n_cameras != previous:
                previous = view // n_cameras
                row[previous] = width - group_seen[g]
                seen[width] = previous
                width += 1
        for place in range(group_landmark[g], group_landmark[g + 1]):
            j = order[place]
            previous = -1
            for m in range(begin[j], begin[j + 1]):
                if keyframe[m] != previous:
                    previous = keyframe[m]
                    pair_keyframe[pairs] = previous
                    pair_row[pairs] = row[previous]
                    pairs += 1
                view = keyframe[m] * n_cameras + camera[m]
                target = at[view]
                at[view] += 1
                observation[target] = m
                obs_landmark[target] = j
                obs_pair[target] = pairs - 1
            landmark_pair[place + 1] = pairs
        for n in range(touched):
            at[views[n]] = 0
        group_run[g + 1] = runs
        group_seen[g + 1] = width
    run_start[runs] = taken
    # The complement marks a pair that an observation before, in this order, has begun.
    begun = np.zeros(pairs, dtype=np.bool_)
    for m in range(taken):
        pair = obs_pair[m]
        if begun[pair]:
            obs_pair[m] = ~pair
        begun[pair] = True
    return pairs, runs, width


@kernel
def gather_pixels(uv: Array, observation: Index, out: Array) -> None:
    """Pixels (M, 2) in another order of observations, u and v apart: ``out`` (2, M)."""
    for m in range(len(observation)):
        out[0, m], out[1, m] = uv[observation[m], 0], uv[observation[m], 1]
