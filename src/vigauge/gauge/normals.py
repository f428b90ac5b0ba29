"""Normals of gauges for anyone's layout: by the pose of a keyframe, the mean pose, a distance, a depth."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import integer, reals
from ..errors import DataError
from ..geometry.charts import poses_of
from ..geometry.so3 import Array
from .gauges import CentroidGauge, FixedGauge, Gauge, KeyframeGauge
from .group import Group, YawTranslation
from .layout import Layout, _moves

# Step of the differences of normal_from: the fourth-order formula is good to 1e-12 there.
_STEP = 1e-3


@dataclass(frozen=True)
class Distance:
    """The scale is given by the distance between two keyframes, by their keys; the seventh constraint."""

    first: Hashable = 0
    second: Hashable = 1


@dataclass(frozen=True)
class MeanDepth:
    """The scale is given by the mean distance of all points from a keyframe, by its key."""

    keyframe: Hashable = 0


def gauge_normal(
    layout: Layout,
    poses: object,
    gauge: Gauge | Distance | MeanDepth | Sequence[Gauge | Distance | MeanDepth],
    *,
    group: Group | None = None,
    points: Array | None = None,
    gravity: object = None,
) -> Array:
    """(n, d) V: derivative of a gauge's constraints by the increments of a layout, transposed.

    ``gauge``: FixedGauge (the first keyframe), KeyframeGauge(key) or CentroidGauge, which constrain the
    position and the turns that the group has; for the scale one of these and Distance or MeanDepth, as a
    tuple. ``KeyframeGauge(key)`` takes the layout's key. The other arguments are those of
    :func:`null_space`.

    Raises DataError for a gauge without such constraints, and for keys or points that are not there.
    """
    group = YawTranslation() if group is None else group
    R, p = poses_of(poses, layout.n_keyframes)
    parts = list(gauge) if isinstance(gauge, Sequence) else [gauge]
    return np.concatenate(
        [_normal(layout, R, p, part, group, points, gravity) for part in parts] or [np.zeros((layout.n, 0))],
        axis=1,
    )


def _normal(
    layout: Layout, R: Array, p: Array, gauge: object, group: Group, points: Array | None, gravity: object
) -> Array:
    keys = list(range(layout.n_keyframes)) if layout.keys is None else list(layout.keys)
    if isinstance(gauge, Distance):
        i, j = layout.place(gauge.first), layout.place(gauge.second)
        ray = p[j] - p[i]
        if not np.any(ray):
            raise DataError("gauge", "a distance needs two keyframes apart", value=gauge)
        ray = ray / np.linalg.norm(ray)
        return _along(layout, R, p, {gauge.first: _of_position(-ray), gauge.second: _of_position(ray)})
    if isinstance(gauge, MeanDepth):
        if not layout.n_points or points is None:
            raise DataError("points", "must be given for a mean depth")
        rays = reals("points", points, (layout.n_points, 3)) - p[layout.place(gauge.keyframe)]
        rays /= np.linalg.norm(rays, axis=1, keepdims=True) * len(rays)
        V = _along(layout, R, p, {gauge.keyframe: _of_position(-rays.sum(axis=0))})
        V[layout.points, 0] = rays
        return V
    moves = [move for move in _moves(group, gravity) if not move.scale]
    functional = np.stack([np.concatenate([m.shift, m.turn]) for m in moves], axis=1)
    if isinstance(gauge, (FixedGauge, KeyframeGauge)):
        key = keys[0] if isinstance(gauge, FixedGauge) else gauge.index
        return _along(layout, R, p, {key: functional})
    if isinstance(gauge, CentroidGauge):
        there = [key for key in keys if len(layout.columns(key, "position"))]
        return _along(layout, R, p, dict.fromkeys(there, functional / len(there)))
    raise DataError(
        "gauge", "must be the first pose, a keyframe, the centroid, a distance or a depth", value=gauge
    )


def _of_position(gradient: Array) -> Array:
    return np.concatenate([gradient, np.zeros(3)])[:, None]


def _along(layout: Layout, R: Array, p: Array, functionals: dict[Hashable, Array]) -> Array:
    """V of linear functions (6, d) of increments in W (position, rotation) of some keyframes."""
    some = next(iter(functionals.values()))
    V = np.zeros((layout.n, some.shape[1]))
    for key, functional in functionals.items():
        world, columns = layout.world_from(key, R, p)
        V[columns] += world.T @ functional
    return V


def normal_from(constraint: Callable[[object], object], retract: Callable[[Array], object], n: int) -> Array:
    """(n, d) V of a gauge of one's own, by differences of its constraints.

    Parameters
    ----------
    constraint : function of an estimate that gives the d constrained numbers
    retract : function that applies an increment (n,) to the estimate, by the estimator's own convention
    n : number of columns of H

    Good to about 1e-11 of the constraints where those are of order one.

    Raises DataError where constraints are not finite numbers, d of them each time.
    """
    n = integer("n", n)

    def at(k: int, step: float) -> Array:
        delta = np.zeros(n)
        delta[k] = step
        return reals("constraint", np.atleast_1d(np.asarray(constraint(retract(delta)))), ("d",))

    rows = []
    for k in range(n):
        near, far = at(k, _STEP) - at(k, -_STEP), at(k, 2 * _STEP) - at(k, -2 * _STEP)
        rows.append((8.0 * near - far) / (12.0 * _STEP))
    return np.array(rows).reshape(n, -1)
