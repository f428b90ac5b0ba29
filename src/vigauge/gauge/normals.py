"""Normals of gauges for anyone's layout: by the pose of a keyframe, the mean pose, a distance, a depth."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..arrays import instance, integer, reals
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
    name: ClassVar[str] = "distance"


@dataclass(frozen=True)
class MeanDepth:
    """The scale is given by the mean distance of all points from a keyframe, by its key."""

    keyframe: Hashable = 0
    name: ClassVar[str] = "depth"


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
    R, p = poses_of(poses, instance("layout", layout, Layout).n_keyframes)
    parts = list(gauge) if isinstance(gauge, Sequence) and not isinstance(gauge, str) else [gauge]
    return np.concatenate(
        [_normal(layout, R, p, part, group, points, gravity) for part in parts] or [np.zeros((layout.n, 0))],
        axis=1,
    )


def _normal(
    layout: Layout, R: Array, p: Array, gauge: object, group: Group, points: Array | None, gravity: object
) -> Array:
    moves = _moves(group, gravity)
    pose = np.concatenate([moves.shift, moves.turn], axis=1)[moves.scale == 0.0].T
    # Derivatives of the constraints by increments in W of each keyframe (position, rotation).
    by_pose = np.zeros((len(p), 6, 1 if isinstance(gauge, (Distance, MeanDepth)) else pose.shape[1]))
    rays = np.empty((0, 3))
    if isinstance(gauge, Distance):
        i, j = _place(layout, gauge.first), _place(layout, gauge.second)
        ray = p[j] - p[i]
        if not np.any(ray):
            raise DataError("gauge", "a distance needs two keyframes apart", value=gauge)
        by_pose[j, :3, 0] = ray / np.linalg.norm(ray)
        by_pose[i] -= by_pose[j]
    elif isinstance(gauge, MeanDepth):
        if not layout.n_points or points is None:
            raise DataError("points", "must be given for a mean depth")
        k = _place(layout, gauge.keyframe)
        rays = reals("points", points, (layout.n_points, 3)) - p[k]
        rays /= np.linalg.norm(rays, axis=1, keepdims=True) * len(rays)
        by_pose[k, :3, 0] = -rays.sum(axis=0)
    elif isinstance(gauge, FixedGauge):
        by_pose[0] = pose
    elif isinstance(gauge, KeyframeGauge):
        by_pose[_place(layout, gauge.index)] = pose
    elif isinstance(gauge, CentroidGauge):
        there = layout.has_pose
        by_pose[there] = pose / max(int(there.sum()), 1)
    else:
        rule = "must be FixedGauge(), KeyframeGauge(key), CentroidGauge(), Distance(i, j) or MeanDepth(key)"
        raise DataError("gauge", rule, value=gauge)
    V = layout.pose_rows(layout.chart.to_world(R, p).swapaxes(1, 2) @ by_pose)
    if len(rays):
        V[layout.points, 0] = rays
    return V


def _place(layout: Layout, key: Hashable) -> int:
    place = layout.place(key)
    if not layout.has_pose[place]:
        raise DataError(
            "gauge", "this keyframe has no pose among the columns of H", value=layout.names[place]
        )
    return place


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
