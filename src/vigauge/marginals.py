"""Blocks of a covariance in any gauge, without the whole matrix: for windows of hundreds of keyframes.

Where the reduced camera system has a band, its inverse is computed inside the band only
(Takahashi, Fagan and Chin 1973), in time linear in the number of keyframes; the gauge then
enters by a projection of rank eight, one block at a time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .covariance import GaugeProjection
from .errors import DataError
from .gauge import Gauge
from .layout import Index
from .normal_equations import ReducedSystem, linearise
from .problem import Problem
from .so3 import Array
from .state import State


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
    out = np.empty((len(wanted), 9, 9))
    for number, keyframe in enumerate(wanted):
        columns = problem.structure.columns[keyframe]
        out[number] = projection.apply_block(projection.inverse.block(columns, columns), columns)
    return out


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
    couplings = reduced.couplings.blocks()
    out = np.empty((len(wanted), 3, 3))
    for number, landmark in enumerate(wanted):
        rows = 9 * state.n_keyframes + 3 * int(landmark) + np.arange(3)
        out[number] = projection.apply_block(_held_block(reduced, couplings, projection, int(landmark)), rows)
    return out


def _held_block(
    reduced: ReducedSystem, couplings: Array, projection: GaugeProjection, landmark: int
) -> Array:
    """(3, 3) block of G: C^-1 + C^-1 W^T G_m W C^-1, over the keyframes that see the landmark."""
    s = reduced.structure
    pairs = s.pairs_of(landmark)
    columns = s.columns[s.pair_keyframe[pairs], :6].ravel()
    W = couplings[pairs].reshape(-1, 3)
    F = reduced.factor[landmark]
    inverse = F.T @ F
    return inverse + inverse @ (W.T @ projection.inverse.block(columns, columns) @ W) @ inverse


def _checked(name: str, wanted: Sequence[int] | Index | None, count: int) -> Index:
    if wanted is None:
        return np.arange(count)
    index = np.asarray(wanted, dtype=np.int64)
    bad = np.flatnonzero((index < 0) | (index >= count))
    if bad.size:
        raise DataError(name, f"must lie in 0..{count - 1}", row=int(bad[0]), value=int(index[bad[0]]))
    return index
