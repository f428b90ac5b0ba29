"""Landmarks side by side, so that one vector instruction works on several of them.

A batch is LANES landmarks of a group, one a lane. What it has with a keyframe is a cell, what it
has with one camera of that keyframe a view: arrays end in the lanes, and a lane that has no
observation there holds zeros, which add nothing to any sum. Zeros cost what numbers cost: one lane in
ten is empty for a flight (a quarter in short windows), nine in ten where tracks are drawn at random.

A loop over lanes that reads and fills rows of one flat array, at distances the compiler knows,
becomes vector instructions however many rows it fills. Therefore kernels work on a scratch array
of rows, copy a cell into it and out of it, and take the number of lanes from an array's shape: a
loop of known length would be unrolled into single instructions instead.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..geometry.so3 import Array
from .compiled import part

Index = NDArray[np.int64]

# Two vectors of eight, four of four. More lanes leave more of them empty where tracks are short (measured).
LANES = 16


class Batches(NamedTuple):
    """Who sees what, by batches.

    Attributes
    ----------
    order : (K,) landmark at each place
    batch_begin : (B + 1,) first place of each batch; lanes past a batch's last landmark repeat that one
    batch_cell : (B + 1,) first cell of each batch
    cell_keyframe, cell_row : (Q,) keyframe of each cell, and its place among those of the batch's group
    cell_view : (Q + 1,) first view of each cell
    view_camera : (V,) camera of each view
    """

    order: Index
    batch_begin: Index
    batch_cell: Index
    cell_keyframe: Index
    cell_row: Index
    cell_view: Index
    view_camera: Index


@part
def gather_points(first: int, last: int, order: Index, points: Array, lanes: int, rows: Array) -> None:
    """Points (K, 3) of the batch at places first..last into rows 0-2."""
    for i in range(lanes):
        j = order[min(first + i, last)]
        rows[i], rows[LANES + i], rows[2 * LANES + i] = points[j, 0], points[j, 1], points[j, 2]
