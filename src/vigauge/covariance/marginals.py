"""Blocks of a covariance in any gauge, without the whole matrix: for windows of hundreds of keyframes.

Where the reduced camera system has a band, its inverse is computed inside the band only
(Takahashi, Fagan and Chin 1973), in time linear in the number of keyframes; the gauge then
enters by a projection of rank eight, one block at a time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import DataError
from ..gauge.gauges import Gauge
from ..geometry.so3 import Array
from ..model.problem import Problem
from ..model.state import State
from ..solver.normal_equations import coupling_blocks, linearise
from ..sparsity.layout import Index
from .covariance import GaugeProjection

# Entries of G that are gathered at a time: two megabytes.
_AT_ONCE = 250_000


def keyframe_covariances(
    problem: Problem, state: State, gauge: Gauge, keyframes: Sequence[int] | Index | None = None
) -> Array:
    """Covariance of (position, rotation, velocity) of some keyframes, all by default, in a gauge.

    Returns
    -------
    (m, 9, 9), units m, rad, m/s: the diagonal blocks of :func:`vigauge.motion_covariance`

    Raises DataError for a keyframe that is not there, DegenerateError where more than the gauge
    is unobservable.
    """
    wanted = _checked("keyframes", keyframes, state.n_keyframes)
    reduced = linearise(problem, state).eliminate()
    projection = GaugeProjection.of(reduced, state, gauge, problem.initial)
    columns = problem.structure.columns[wanted]
    return projection.apply_blocks(projection.inverse.blocks(columns), columns)


def landmark_covariances(
    problem: Problem, state: State, gauge: Gauge, landmarks: Sequence[int] | Index | None = None
) -> Array:
    """Covariance of some landmarks' positions, all by default, in a gauge.

    Returns
    -------
    (m, 3, 3), m^2

    Raises DataError for a landmark that is not there, DegenerateError where more than the gauge
    is unobservable.
    """
    wanted = _checked("landmarks", landmarks, state.n_landmarks)
    reduced = linearise(problem, state).eliminate()
    projection = GaugeProjection.of(reduced, state, gauge, problem.initial, landmarks=True)
    s, n_motion = reduced.structure, 9 * state.n_keyframes
    W, inverses = coupling_blocks(s, reduced.couplings), reduced.landmark_inverses()
    first, end = s.pairs.begin[wanted], s.pairs.begin[wanted + 1]
    out = np.empty((len(wanted), 3, 3))
    # Landmarks with equally many pairs together, not too many at a time.
    for count in np.unique(end - first):
        alike = np.flatnonzero(end - first == count)
        for some in np.array_split(alike, 1 + len(alike) * (6 * int(count)) ** 2 // _AT_ONCE):
            pairs = first[some, None] + np.arange(count)
            columns = s.columns[s.pairs.keyframe[pairs], :6].reshape(len(some), -1)
            motion = projection.inverse.blocks(columns)
            G = _held_blocks(inverses[wanted[some]], motion, W[pairs].reshape(len(some), -1, 3))
            out[some] = projection.apply_blocks(G, n_motion + 3 * wanted[some, None] + np.arange(3))
    return out


def _held_blocks(inverse: Array, motion: Array, W: Array) -> Array:
    """(m, 3, 3) blocks of G: C^-1 + C^-1 W^T G_m W C^-1, over the keyframes that see each landmark."""
    return inverse + inverse @ (W.swapaxes(1, 2) @ motion @ W) @ inverse


def _checked(name: str, wanted: Sequence[int] | Index | None, count: int) -> Index:
    if wanted is None:
        return np.arange(count)
    index = np.asarray(wanted, dtype=np.int64)
    bad = np.flatnonzero((index < 0) | (index >= count))
    if bad.size:
        raise DataError(name, f"must lie in 0..{count - 1}", row=int(bad[0]), value=int(index[bad[0]]))
    return index
