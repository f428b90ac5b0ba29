"""How a sparse symmetric matrix is eliminated: the tree, what its factor reaches, and the fronts.

Columns that stand together are a node; nodes with alike columns of the factor are merged into a front, so
that all later work is products of dense matrices.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .compiled import kernel
from .lanes import Index

# Fronts of fewer columns are merged with the next where that adds few zeros (measured).
_NARROW = 48
_ZEROS = 0.25
# Nodes are ordered in pairs where they share so many of their neighbours (measured).
_ALIKE = 0.75


class Fronts(NamedTuple):
    """Ranges of the elimination order, children before parents, one branch after the other.

    start (F + 1,) first column of each; parent (F,), -1 for none; begin (F + 1,) where its rows below stand
    in ``rows`` (places in the elimination order, sorted) and ``relative`` (places among the parent's rows,
    its own columns first); panel (F + 1,) where its columns of the factor stand in a storage.
    """

    start: Index
    parent: Index
    begin: Index
    rows: Index
    relative: Index
    panel: Index


@kernel
def neighbours(begin: Index, row: Index, node: Index, columns: Index, first: Index) -> tuple[Index, Index]:
    """Graph of the nodes of a matrix in compressed columns, itself in compressed columns.

    ``node`` (n,) of each column, -1 where it is left out. Columns of node k are
    ``columns[first[k] : first[k + 1]]``.
    """
    count = len(first) - 1
    start, seen = np.zeros(count + 1, np.int64), np.full(count, -1)
    reach = np.empty(len(row), np.int64)
    top = 0
    for k in range(count):
        for column in columns[first[k] : first[k + 1]]:
            for e in range(begin[column], begin[column + 1]):
                other = node[row[e]]
                if other >= 0 and seen[other] != k:
                    seen[other] = k
                    reach[top] = other
                    top += 1
        start[k + 1] = top
    return start, reach[:top].copy()


@kernel
def pairs(start: Index, neighbour: Index) -> Index:
    """A number for each node, the same for two that follow one another and have nearly the same neighbours.

    Keyframes of a chain: ordered in pairs, they make fewer and wider fronts.
    """
    count = len(start) - 1
    number, seen = np.empty(count, np.int64), np.full(count, -1)
    top, k = 0, 0
    while k < count:
        number[k] = top
        for other in neighbour[start[k] : start[k + 1]]:
            seen[other] = k
        if k + 1 < count and seen[k + 1] == k:
            shared = 0
            for other in neighbour[start[k + 1] : start[k + 2]]:
                shared += seen[other] == k
            if shared >= _ALIKE * max(start[k + 1] - start[k], start[k + 2] - start[k + 1]):
                k += 1
                number[k] = top
        top, k = top + 1, k + 1
    return number


@kernel
def eliminate(start: Index, neighbour: Index, order: Index) -> tuple[Index, Index, Index]:
    """An elimination order as sparse as the one given, and what the factor reaches below each node.

    Children stand before parents, one branch after the other. Returns that order, begin and reach: places
    below node k are ``reach[begin[k] : begin[k + 1]]``, sorted.
    """
    count = len(order)
    place, parent, ancestor = np.empty(count, np.int64), np.full(count, -1), np.full(count, -1)
    for k in range(count):
        place[order[k]] = k
    for k in range(count):
        for other in neighbour[start[order[k]] : start[order[k] + 1]]:
            i = place[other]
            while i != -1 and i < k:
                above, ancestor[i] = ancestor[i], k
                if above == -1:
                    parent[i] = k
                i = above
    size = np.ones(count + 1, np.int64)
    for k in range(count):
        size[parent[k]] += size[k]
    # Where the branch of each node ends; the last entry is that of all roots.
    end, after = np.empty(count + 1, np.int64), np.empty(count, np.int64)
    end[-1] = count
    for k in range(count - 1, -1, -1):
        end[parent[k]] -= 1
        place[order[k]] = end[k] = end[parent[k]]
        end[parent[k]] -= size[k] - 1
    for node in range(count):
        after[place[node]] = node

    begin, reach = np.zeros(count + 1, np.int64), np.empty(8 * count, np.int64)
    last, sibling, seen = np.full(count, -1), np.full(count, -1), np.full(count, -1)
    for k in range(count):
        top = begin[k]
        if top + count > len(reach):
            reach = np.append(reach, np.empty(len(reach) + count, np.int64))
        for other in neighbour[start[after[k]] : start[after[k] + 1]]:
            i = place[other]
            if i > k and seen[i] != k:
                seen[i] = k
                reach[top] = i
                top += 1
        child = last[k]
        while child != -1:
            for i in reach[begin[child] : begin[child + 1]]:
                if i > k and seen[i] != k:
                    seen[i] = k
                    reach[top] = i
                    top += 1
            child = sibling[child]
        begin[k + 1] = top
        if top > begin[k]:
            reach[begin[k] : top].sort()
            above = reach[begin[k]]
            sibling[k], last[above] = last[above], k
    return after, begin, reach[: begin[-1]].copy()


@kernel
def merge(begin: Index, reach: Index, first: Index) -> Fronts:
    """Fronts: chains of nodes whose columns of the factor reach the same rows, or nearly so.

    ``begin`` and ``reach`` as :func:`eliminate` gives them; columns of node k are the places first[k] to
    first[k + 1].
    """
    count = len(begin) - 1
    rows_below = np.zeros(count, np.int64)
    for k in range(count):
        for other in reach[begin[k] : begin[k + 1]]:
            rows_below[k] += first[other + 1] - first[other]
    # The last node of each front, and the front of each node.
    last, owner, fronts = np.empty(count, np.int64), np.empty(count, np.int64), 0
    opened = 0
    for k in range(count):
        owner[k] = fronts
        joins = begin[k + 1] > begin[k] and reach[begin[k]] == k + 1
        if joins:
            ahead = rows_below[k + 1] + first[k + 2] - first[k + 1]
            narrow = first[k + 1] - first[opened] < _NARROW
            joins = rows_below[k] == ahead or (narrow and rows_below[k] >= (1.0 - _ZEROS) * ahead)
        if not joins:
            last[fronts] = k
            fronts += 1
            opened = k + 1
    start, parent = np.zeros(fronts + 1, np.int64), np.full(fronts, -1)
    below, panel = np.zeros(fronts + 1, np.int64), np.zeros(fronts + 1, np.int64)
    for f in range(fronts):
        # Rows of the last node of a chain hold those of the nodes before it.
        k = last[f]
        start[f + 1], below[f + 1] = first[k + 1], below[f] + rows_below[k]
        size = start[f + 1] - start[f]
        panel[f + 1] = panel[f] + size * (size + rows_below[k])
        if rows_below[k]:
            parent[f] = owner[reach[begin[k]]]
    rows, relative = np.empty(below[-1], np.int64), np.empty(below[-1], np.int64)
    for f in range(fronts - 1, -1, -1):
        top, p = below[f], parent[f]
        for other in reach[begin[last[f]] : begin[last[f] + 1]]:
            for i in range(first[other], first[other + 1]):
                rows[top] = i
                top += 1
        at = below[p]
        for e in range(below[f], top):
            if rows[e] < start[p + 1]:
                relative[e] = rows[e] - start[p]
            else:
                while rows[at] != rows[e]:
                    at += 1
                relative[e] = start[p + 1] - start[p] + at - below[p]
    return Fronts(start, parent, below, rows, relative, panel)
