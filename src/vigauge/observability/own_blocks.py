"""What an information matrix says of one keyframe or point by itself, and which of them it joins."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.sparse
from scipy.sparse.csgraph import connected_components

from ..gauge.layout import POSE, Layout
from ..geometry.so3 import Array
from ..sparsity.rounding import rounding

# So many are named; a user mends the first and asks again.
_NAMED = 4
# Share of a direction outside the gauge's above which it is one of its own.
_OUTSIDE = 1e-6


def unmeasured(H: Any, layout: Layout, scale: Array, N: Array) -> str:
    """'point 7 in 1 direction, velocity of keyframe 3 in 3': those whose own block is singular; '' for none.

    H is positive semidefinite, so what a keyframe's or point's own block does not see, H does not see.

    Parameters
    ----------
    scale : (n,) by which rows and columns of H have a unit diagonal
    N : (n, d) orthonormal directions of the gauge in that scale, which may be missed
    """
    found: list[str] = []
    more = 0
    for columns, block in _own_blocks(H, layout):
        size = scale[columns]
        values, vectors = np.linalg.eigh(block * size[:, None] * size)
        null = vectors[:, values <= rounding(len(columns))]
        null = null[:, np.linalg.norm(null - N[columns] @ (N[columns].T @ null), axis=0) > _OUTSIDE]
        if not null.shape[1]:
            continue
        if len(found) == _NAMED:
            more += 1
            continue
        name = layout.name_of(int(columns[np.argmax(np.abs(null).max(axis=1))]))
        found.append(f"{name} in {null.shape[1]} direction{'s' * (null.shape[1] > 1)}")
    return ", ".join(found) + (f" and {more} more" if more else "")


def _own_blocks(H: Any, layout: Layout) -> Iterator[tuple[np.ndarray, Array]]:
    """Columns and block of H of each keyframe, point or column without a name."""
    nodes = layout.nodes
    order = np.argsort(nodes, kind="stable")
    counts = np.bincount(nodes)
    place = np.empty(layout.n, dtype=np.int64)
    place[order] = np.arange(layout.n) - np.repeat(np.cumsum(counts) - counts, counts)
    starts = np.cumsum(counts**2) - counts**2
    entries = np.zeros(int(np.sum(counts**2)))
    coo = scipy.sparse.coo_array(H)
    own = nodes[coo.row] == nodes[coo.col]
    row, column = coo.row[own], coo.col[own]
    entries[starts[nodes[row]] + place[row] * counts[nodes[row]] + place[column]] = coo.data[own]
    for columns, start in zip(np.split(order, np.cumsum(counts)[:-1]), starts.tolist(), strict=True):
        yield columns, entries[start : start + len(columns) ** 2].reshape(len(columns), -1)


def separate(H: Any, layout: Layout) -> str:
    """'keyframes 0, 1, 2 and keyframes 3, 4': poses that no entry of H joins; '' where all are joined."""
    rows = np.flatnonzero(layout.has_pose)
    if not len(rows):
        return ""
    coo = scipy.sparse.coo_array(H)
    joined = coo.data != 0.0
    nodes, count = layout.nodes, int(layout.nodes.max(initial=-1)) + 1
    graph = scipy.sparse.coo_array(
        (np.ones(int(joined.sum())), (nodes[coo.row[joined]], nodes[coo.col[joined]])), shape=(count, count)
    )
    part = connected_components(graph, directed=False)[1]
    columns = layout.columns_of([kind for kind in POSE if kind in layout.blocks])
    parts = part[nodes[columns[rows].max(axis=1)]]
    members = [rows[parts == one] for one in dict.fromkeys(parts.tolist())]
    if len(members) < 2:
        return ""
    texts = [
        ", ".join(str(layout.names[row]) for row in own[:_NAMED].tolist()) + ", ..." * (len(own) > _NAMED)
        for own in members[:_NAMED]
    ]
    return " and keyframes ".join(texts) + " and others" * (len(members) > _NAMED)
