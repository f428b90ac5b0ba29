"""What the columns of anyone's information matrix stand for, and the directions that nothing measures.

Conventions are data: which columns are the position, rotation and velocity of which keyframe, which are
points, and by which chart a pose moves. The null space follows from them.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import instance, integer, integers, reals
from ..errors import DataError
from ..geometry.charts import Chart, chart_named, poses_of
from ..geometry.so3 import Array, hat
from .group import Group, YawTranslation, dimension

Index = NDArray[np.int64]
POSE = ("position", "rotation")
_KNOWN = {"position": 3, "rotation": 3, "velocity": 3}
_UP = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Layout:
    """Which columns of H belong to what. :meth:`by_keyframe` and :meth:`by_kind` make the usual ones.

    Attributes
    ----------
    n : number of columns of H
    blocks : columns of each kind of parameter of the keyframes, (N, c) each, rows of -1 where a keyframe has
        none. "position" (N, 3), "rotation" (N, 3) and "velocity" (N, 3) move with the gauge; in the plane
        "position" (N, 2) and "rotation" (N, 1). Other kinds do not move (biases), but those in ``vectors``
    points : (K, 3) columns of landmarks' positions in W
    side : the chart of the poses: "left", "right", "gtsam", "se3", "colmap", "ceres" or "g2o", see
        :func:`vigauge.as_convention`
    vectors : kinds that the gauge turns as it turns velocities, but does not scale (a magnetic field in W)
    keys : names of the keyframes, 0, 1, ... where none are given
    point_keys : names of the points, 0, 1, ... where none are given

    Columns that no block names do not move with the gauge.

    Raises DataError for columns outside 0..n-1 or named twice, and for an unknown side.
    """

    n: int
    blocks: Mapping[str, Index]
    points: Index = field(default_factory=lambda: np.empty((0, 3), dtype=np.int64))
    side: str = "left"
    vectors: tuple[str, ...] = ()
    keys: Sequence[Hashable] | None = None
    point_keys: Sequence[Hashable] | None = None

    def __post_init__(self) -> None:
        integer("layout", self.n, field="n")
        chart_named("side", self.side)
        instance("blocks", self.blocks, Mapping)
        checked = {kind: integers("layout", c, ("N", "c"), field=kind) for kind, c in self.blocks.items()}
        points = integers("layout", self.points, ("K", 3), field="points")
        object.__setattr__(self, "blocks", checked)
        object.__setattr__(self, "points", points)
        lengths = {kind: len(columns) for kind, columns in checked.items()}
        if len(set(lengths.values())) > 1:
            raise DataError("layout", "blocks must have one row for each keyframe", value=lengths)
        for kind, widths in {"position": (2, 3), "rotation": (1, 3), "velocity": (2, 3)}.items():
            if kind in checked and checked[kind].shape[1] not in widths:
                raise DataError(
                    "layout", f"must have {widths[1]} columns", field=kind, value=checked[kind].shape
                )
        named = np.concatenate([*(c.ravel() for c in checked.values()), points.ravel(), np.empty(0, int)])
        named = named[named != -1]
        if named.size and not (named.min() >= 0 and named.max() < self.n):
            worst = int(named.max()) if named.max() >= self.n else int(named.min())
            raise DataError("layout", f"columns must lie in 0..{self.n - 1}", value=worst)
        counts = np.bincount(named, minlength=1)
        if counts.max() > 1:
            raise DataError("layout", "a column must be named once", field=f"column {int(np.argmax(counts))}")
        for what, keys, count in (
            ("keys", self.keys, self.n_keyframes),
            ("point_keys", self.point_keys, len(points)),
        ):
            if keys is not None and (len(keys) != count or len(set(keys)) != count):
                raise DataError("layout", f"must be {count} different names", field=what, value=len(keys))

    @classmethod
    def by_keyframe(
        cls, count: int, blocks: Sequence[str], *, points: int = 0, side: str = "left", **more: object
    ) -> Layout:
        """Keyframe by keyframe, the blocks of each in the order given, then ``points`` landmarks.

        ``blocks`` names "position", "rotation", "velocity", others with their number of columns ("bias:6").
        """
        return cls._regular(count, blocks, points, True, side, more)

    @classmethod
    def by_kind(
        cls, count: int, blocks: Sequence[str], *, points: int = 0, side: str = "left", **more: object
    ) -> Layout:
        """As :meth:`by_keyframe`, with the first block of all keyframes before the second of all."""
        return cls._regular(count, blocks, points, False, side, more)

    @classmethod
    def _regular(
        cls,
        count: int,
        blocks: Sequence[str],
        points: int,
        interleaved: bool,
        side: str,
        more: Mapping[str, object],
    ) -> Layout:
        count, points = integer("keyframes", count), integer("points", points)
        widths: dict[str, int] = {}
        for block in instance("blocks", blocks, Sequence):
            kind, _, given = instance("blocks", block, str).partition(":")
            if not (given.isdigit() or (kind in _KNOWN and not given)):
                raise DataError(
                    "blocks", 'must be position, rotation, velocity, or "name:columns"', value=block
                )
            widths[kind] = int(given) if given else _KNOWN[kind]
        stride, start, columns = sum(widths.values()), 0, {}
        for kind, width in widths.items():
            first, step = (start, stride) if interleaved else (count * start, width)
            columns[kind] = first + step * np.arange(count)[:, None] + np.arange(width)
            start += width
        at = count * stride + np.arange(3 * points).reshape(-1, 3)
        return cls(count * stride + 3 * points, columns, at, side, **more)  # type: ignore[arg-type]

    @property
    def n_keyframes(self) -> int:
        return next((len(columns) for columns in self.blocks.values()), 0)

    @property
    def n_points(self) -> int:
        return len(self.points)

    @cached_property
    def chart(self) -> Chart:
        return chart_named("side", self.side)

    @cached_property
    def _place(self) -> dict[Hashable, int]:
        keys = range(self.n_keyframes) if self.keys is None else self.keys
        return {key: place for place, key in enumerate(keys)}

    @cached_property
    def _point_place(self) -> dict[Hashable, int]:
        keys = range(self.n_points) if self.point_keys is None else self.point_keys
        return {key: place for place, key in enumerate(keys)}

    def place(self, key: Hashable) -> int:
        """Row of a keyframe by its key; DataError for a key that is not there."""
        return _found("keyframe", self._place, key)

    def point_place(self, key: Hashable) -> int:
        """Row of a point by its key; DataError for a key that is not there."""
        return _found("point", self._point_place, key)

    def columns(self, key: Hashable, kind: str | None = None) -> Index:
        """Columns of a keyframe, all of them or those of one kind, in the order of the layout's blocks.

        Raises DataError for a key or kind that is not there.
        """
        row = self.place(key)
        if kind is not None and kind not in self.blocks:
            raise DataError("kind", f"must be one of {', '.join(self.blocks)}", value=kind)
        parts = [c[row] for name, c in self.blocks.items() if kind in (None, name)]
        columns = np.concatenate(parts)
        return columns[columns >= 0]

    @cached_property
    def names(self) -> list[Hashable]:
        """Keys of all keyframes, in the order of their rows; 0, 1, ... where none were given."""
        return list(self._place)

    def columns_of(self, kinds: Iterable[str]) -> Index:
        """(N, c) columns of some kinds, -1 where a keyframe has none; DataError for an unknown kind."""
        kinds = list(instance("kinds", kinds, Iterable))
        for kind in kinds or ("",):
            if not isinstance(kind, str) or kind not in self.blocks:
                raise DataError("kind", f"must be one of {', '.join(self.blocks)}", value=kind)
        return np.concatenate([self.blocks[kind] for kind in kinds], axis=1)

    def places_having(self, kinds: Iterable[str]) -> Index:
        """(m,) rows of the keyframes with all columns of these kinds; DataError for a kind not there."""
        return np.flatnonzero(np.all(self.columns_of(kinds) >= 0, axis=1))

    def having(self, kinds: Iterable[str]) -> list[Hashable]:
        """Keys of the keyframes with all columns of these kinds; DataError for a kind that is not there."""
        return [self.names[row] for row in self.places_having(kinds).tolist()]

    @cached_property
    def nodes(self) -> Index:
        """(n,) a number for each column, equal for those of one keyframe, point, or column without a name."""
        node = np.full(self.n + 1, -1, dtype=np.int64)
        for columns in self.blocks.values():
            node[columns] = np.arange(self.n_keyframes)[:, None]
        node[self.points] = self.n_keyframes + np.arange(self.n_points)[:, None]
        node = node[:-1]  # the last took the -1 of missing blocks
        alone = np.flatnonzero(node < 0)
        node[alone] = self.n_keyframes + self.n_points + np.arange(len(alone))
        return np.unique(node, return_inverse=True)[1].astype(np.int64)

    def name_of(self, column: int) -> str:
        """'velocity of keyframe 7', 'point 3', 'column 12': what a column stands for."""
        for kind, columns in self.blocks.items():
            row = np.flatnonzero((columns == column).any(axis=1))
            if row.size:
                return f"{kind} of keyframe {self.names[int(row[0])]}"
        row = np.flatnonzero((self.points == column).any(axis=1))
        return f"point {list(self._point_place)[int(row[0])]}" if row.size else f"column {column}"

    def with_points(self, count: int) -> Layout:
        """The layout of the whole where this one is that of a Schur complement: ``count`` points follow."""
        columns = self.n + np.arange(3 * count).reshape(-1, 3)
        return replace(self, n=self.n + 3 * count, points=np.concatenate([self.points, columns]))

    @cached_property
    def has_pose(self) -> NDArray[np.bool_]:
        """(N,) whether H has columns of a keyframe's position or rotation."""
        there = np.zeros(self.n_keyframes, dtype=bool)
        for kind in ("position", "rotation"):
            if kind in self.blocks:
                there |= (self.blocks[kind] >= 0).any(axis=1)
        return there

    def pose_rows(self, own: Array, others: Mapping[str, Array] | None = None) -> Array:
        """(n, d) rows of own increments of poses (N, 6, d) (position, rotation) and of other kinds."""
        out = np.zeros((self.n + 1, own.shape[2]))
        parts = {"position": own[:, :3], "rotation": own[:, 3:], **(others or {})}
        for kind, columns in self.blocks.items():
            if kind in parts:
                width = columns.shape[1]
                # In the plane: x and y, and the turn about z.
                out[columns] = parts[kind][:, 3 - width :] if kind == "rotation" else parts[kind][:, :width]
        return out[:-1]  # the last took the -1 of missing columns

    def world_from(self, key: Hashable, R: Array, p: Array) -> tuple[Array, Index]:
        """(6, c) increment in W (position, rotation) of a keyframe by its c pose columns, and these."""
        row = self.place(key)
        inverse = self.chart.to_world(R[row : row + 1], p[row : row + 1])[0]
        parts, columns = [], []
        for kind in ("position", "rotation"):
            if kind in self.blocks:
                own = self.blocks[kind][row]
                width, there = len(own), own >= 0
                part = inverse[:, 6 - width : 6] if kind == "rotation" else inverse[:, :width]
                parts.append(part[:, there])
                columns.append(own[there])
        if not sum(map(len, columns)):
            raise DataError("key", "this keyframe has no pose among the columns of H", value=self.names[row])
        return np.concatenate(parts, axis=1), np.concatenate(columns)


def _found(what: str, places: Mapping[Hashable, int], key: Hashable) -> int:
    # A bool would be taken for 0 or 1.
    place = places.get(key) if isinstance(key, Hashable) and not isinstance(key, (bool, np.bool_)) else None
    if place is None:
        such = f", such as {next(iter(places))!r}" if places else ", which has none"
        raise DataError("key", f"must be that of a {what} of the layout{such}", value=key)
    return place


class _Moves(NamedTuple):
    """The d generators of a group, a row each: X <- X + turn x X + shift + scale X."""

    turn: Array
    shift: Array
    scale: Array

    def turned(self, X: Array) -> Array:
        """(K, 3, d) turn x X."""
        return -hat(X) @ self.turn.T

    def scaled(self, X: Array) -> Array:
        """(K, 3, d) turn x X + scale X."""
        return self.turned(X) + X[:, :, None] * self.scale


def _moves(group: Group, gravity: object) -> _Moves:
    instance("group", group, Group)
    up = np.array(_UP)
    if gravity is not None:
        g = reals("gravity", gravity, (3,))
        if not np.any(g):
            raise DataError("gravity", "must have a direction", value=g)
        up = -g / np.linalg.norm(g)
    axes, none = np.eye(3), np.zeros(3)
    known = {name: (none, axis, 0.0) for name, axis in zip("xyz", axes, strict=True)}
    known |= {name: (axis, none, 0.0) for name, axis in zip(("roll", "pitch", "yaw"), axes, strict=True)}
    known["scale"] = (none, none, 1.0)
    if "roll" not in group.directions:
        known["yaw"] = (up, none, 0.0)
    unknown = [name for name in group.directions if name not in known]
    if unknown:
        raise DataError("group", f"directions must be among {', '.join(known)}", value=unknown)
    return _Moves(*map(np.array, zip(*(known[name] for name in group.directions), strict=True)))


def null_space(
    layout: Layout,
    poses: object,
    velocities: Array | None = None,
    points: Array | None = None,
    *,
    group: Group | None = None,
    gravity: object = None,
    vectors: Mapping[str, Array] | None = None,
) -> Array:
    """(n, d) the directions along which a group moves an estimate, by the increments of its layout.

    Turns and the scale are about the middle of the positions, not the origin: far from it they would be
    nearly shifts, and products of them lose all digits. The span is the same.

    Parameters
    ----------
    layout : what the columns stand for
    poses : (N, 4, 4) or (N, 3, 4) T_WB, or a pair R_WB (N, 3, 3), p_W (N, 3); for "colmap" the inverses of
        cam_from_world
    velocities : (N, 3) in W, where the layout has them
    points : (K, 3) in W, where the layout has them
    group : YawTranslation (4 directions, the default), Euclidean (6) or Similarity (7)
    gravity : (3,) along gravity in W, (0, 0, -1) if not given; yaw turns about it
    vectors : (N, 3) values in W of the layout's further vectors, by kind

    Raises DataError for shapes that do not fit the layout, or values that it needs and that are missing.
    """
    group = YawTranslation() if group is None else group
    R, p = poses_of(poses, instance("layout", layout, Layout).n_keyframes)
    moves = _moves(group, gravity)
    centre = p.mean(axis=0) if len(p) else np.zeros(3)
    world = np.empty((len(p), 6, dimension(group)))
    world[:, :3] = moves.scaled(p - centre) + moves.shift.T
    world[:, 3:] = moves.turn.T
    others: dict[str, Array] = {}
    if "velocity" in layout.blocks:
        v = _needed("velocities", velocities, layout.n_keyframes)
        others["velocity"] = moves.scaled(v)
    for kind in layout.vectors:
        value = _needed("vectors", (vectors or {}).get(kind), layout.n_keyframes, kind)
        others[kind] = moves.turned(value)
    U = layout.pose_rows(layout.chart.from_world(R, p) @ world, others)
    if layout.n_points:
        X = _needed("points", points, layout.n_points) - centre
        U[layout.points] = moves.scaled(X) + moves.shift.T
    return U


def _needed(what: str, value: Array | None, count: int, kind: str | None = None) -> Array:
    if value is None:
        raise DataError(what, "must be given: the layout has columns of them", field=kind)
    return reals(what, value, (count, 3), field=kind)
