"""The covariance of a GTSAM estimate in any gauge, addressed by GTSAM's keys. Needs the package gtsam."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..covariance.estimate import EstimateCovariance
from ..errors import DataError
from ..gauge.group import Euclidean, Group, YawTranslation
from ..gauge.layout import Index, Layout
from .gtsam_graph import KINDS, linearised, variables
from .information import Information


def covariance(
    graph: Any, values: Any, *, gravity: object = (0.0, 0.0, -9.81), group: Group | None = None
) -> EstimateCovariance:
    """The covariance of all variables of a graph at an estimate, to be asked for by GTSAM's keys.

    The graph is linearised here, with the weights of its robust noise models. Leave out priors that only
    fix the gauge: what is absolute in the graph counts as measured. Columns are in GTSAM's order and
    sides: Pose3 (rotation, position), both in the body; Pose2 (x, y in the body, angle); ConstantBias
    (accelerometer, gyroscope). A 3-vector is a velocity or a point, as its factors with poses say. Poses,
    velocities and biases are keyframes of the answer's layout, points its points, each under its own key.

    Parameters
    ----------
    graph : gtsam.NonlinearFactorGraph
    values : gtsam.Values, the estimate; variables that no factor names are left out
    gravity : (3,) along gravity in the world, for graphs with velocities; None where nothing measured it
    group : if not given, YawTranslation with velocities and gravity, else Euclidean (in the plane 3 of its 6)

    Raises
    ------
    DataError
        for a variable without a value or of another type, 3-vectors that are neither velocity nor point, hard
        constraints, a graph without poses or with poses of two types
    DegenerateError
        where more than the group is unobservable
    """
    return information(graph, values, gravity=gravity, group=group).covariance()


def information(
    graph: Any, values: Any, *, gravity: object = (0.0, 0.0, -9.81), group: Group | None = None
) -> Information:
    """Information matrix, layout and estimate, by the arguments of :func:`covariance`, to ``audit()``."""
    found = variables(graph, values)
    kinds = {kind for kind, _ in found.values()}
    if "Pose3" not in kinds and kinds != {"Pose2"} or {"Pose2", "Pose3"} <= kinds:
        raise DataError("graph", "must have poses: Pose3 with velocities, biases and points, or Pose2 alone")
    at, n = {}, 0
    for key, (kind, _) in found.items():
        at[key] = np.arange(n, n := n + sum(KINDS[kind][1].values()))
    H, points = linearised(graph.linearize(values), found, at, n)
    # Poses are first: a gauge that holds the first keyframe holds one.
    by_kind: dict[str, list[int]] = {kind: [] for kind in KINDS if kind in kinds}
    for key in sorted(found.keys() - set(points)):
        by_kind[found[key][0]].append(key)
    keys = [key for own in by_kind.values() for key in own]
    blocks: dict[str, Index] = {}
    R, p, v = np.tile(np.eye(3), (len(keys), 1, 1)), np.zeros((len(keys), 3)), np.zeros((len(keys), 3))
    stop = poses = 0
    for kind, own in by_kind.items():
        rows, stop = slice(stop, stop + len(own)), stop + len(own)
        if not own:
            continue
        columns = np.array([at[key] for key in own])
        for name, width in KINDS[kind][1].items():
            blocks.setdefault(name, np.full((len(keys), width), -1))[rows] = columns[:, :width]
            columns = columns[:, width:]
        if kind.startswith("Pose"):
            value, poses = np.array([found[key][1] for key in own]), stop
            R[rows], p[rows] = value[:, :3, :3], value[:, :3, 3]
        elif kind == "velocity":
            v[rows] = [found[key][1] for key in own]
    p[poses:] = p[:poses].mean(axis=0)  # these have no columns; the middle stays where it is
    X = np.reshape([found[key][1] for key in points], (-1, 3))
    place = np.reshape([at[key] for key in points], (-1, 3)).astype(np.int64)
    layout = Layout(n, blocks, place, "gtsam", keys=keys, point_keys=points)
    if group is None:
        group = YawTranslation() if "velocity" in blocks and gravity is not None else Euclidean()
    return Information(H, layout, R, p, v, X, group, gravity)
