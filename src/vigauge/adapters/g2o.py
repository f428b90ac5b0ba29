"""The covariance of a pose graph in g2o's text format in any gauge, addressed by its vertices' numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sparse
from scipy.spatial.transform import Rotation

from ..arrays import LARGEST
from ..covariance.estimate import EstimateCovariance
from ..errors import DataError
from ..gauge.group import Euclidean
from ..gauge.layout import Layout
from ..geometry.so3 import Array, hat
from ..model.text_file import PathLike, number_in, read_text, require_unit
from .information import Information

# Numbers of a vertex, and columns of its increment.
_VERTICES = {"VERTEX_SE2": (3, 3), "VERTEX_XY": (2, 2), "VERTEX_SE3:QUAT": (7, 6), "VERTEX_TRACKXYZ": (3, 3)}
_POSES = ("VERTEX_SE2", "VERTEX_SE3:QUAT")
# Ends of an edge, numbers of its measurement, residuals. TRACKXYZ names the sensor's offset after the ends.
_EDGES = {
    "EDGE_SE2": ("VERTEX_SE2", "VERTEX_SE2", 3, 3),
    "EDGE_SE2_XY": ("VERTEX_SE2", "VERTEX_XY", 2, 2),
    "EDGE_SE3:QUAT": ("VERTEX_SE3:QUAT", "VERTEX_SE3:QUAT", 7, 6),
    "EDGE_SE3_TRACKXYZ": ("VERTEX_SE3:QUAT", "VERTEX_TRACKXYZ", 3, 3),
}
_OFFSET, _FIX = "PARAMS_SE3OFFSET", "FIX"
# What the information of EDGE_SE3:QUAT is about, and the unit of a rotation by a quaternion's vector part.
ROTATIONS = {"quaternion": 1.0, "angle": 2.0}
# Share of its largest eigenvalue that an edge's information may be negative: the rounding of six digits.
_ROUNDED = 1e-5


class _Edge(NamedTuple):
    line: int
    ends: tuple[int, int]
    offset: int
    measured: list[float]
    information: Array


class _Graph:
    """What a file says; every number of a vertex that it names is there."""

    def __init__(self, path: PathLike) -> None:
        self.path = path
        self.vertices: dict[int, tuple[str, list[float]]] = {}
        self.offsets: dict[int, list[float]] = {}
        self.edges: dict[str, list[_Edge]] = {tag: [] for tag in _EDGES}
        lines: dict[int, int] = {}
        fixed: set[int] = set()
        for line, text in enumerate(read_text(path).splitlines(), start=1):
            tag, *cells = text.partition("#")[0].split() or [""]
            if tag in _VERTICES or tag == _OFFSET:
                count = _VERTICES[tag][0] if tag in _VERTICES else 7
                (number,), values = self._split(line, tag, cells, 1, count)
                known = self.vertices if tag in _VERTICES else self.offsets
                if number in known:
                    raise DataError(path, "must have a number of its own", row=line, field=tag, value=number)
                if tag in _VERTICES:
                    self.vertices[number], lines[number] = (tag, values), line
                else:
                    self.offsets[number] = values
            elif tag in _EDGES:
                self.edges[tag].append(self._edge(line, tag, cells))
            elif tag == _FIX:
                fixed |= {self._index(line, tag, cell) for cell in cells}
            elif tag:
                rule = f"must be one of {', '.join([*_VERTICES, *_EDGES, _OFFSET, _FIX])}"
                raise DataError(path, rule, row=line, value=tag)
        self._require_whole(lines, fixed)

    def _index(self, line: int, tag: str, cell: str) -> int:
        if not (cell.isascii() and cell.isdigit() and len(cell) < 19):
            raise DataError(self.path, "must be the number of a vertex", row=line, field=tag, value=cell)
        return int(cell)

    def _split(
        self, line: int, tag: str, cells: Sequence[str], numbers: int, count: int
    ) -> tuple[list[int], list[float]]:
        """Leading numbers of vertices and parameters, and the values; a pose's quaternion has length 1."""
        if len(cells) != numbers + count:
            rule = f"must have {numbers + count} columns after its name"
            raise DataError(self.path, rule, row=line, field=tag, value=len(cells))
        values = [number_in(self.path, line, cell, tag) for cell in cells[numbers:]]
        if tag in ("VERTEX_SE3:QUAT", "EDGE_SE3:QUAT", _OFFSET):
            require_unit(self.path, line, values[3:7])
        return [self._index(line, tag, cell) for cell in cells[:numbers]], values

    def _edge(self, line: int, tag: str, cells: Sequence[str]) -> _Edge:
        _, other, count, size = _EDGES[tag]
        extra = other == "VERTEX_TRACKXYZ"
        numbers, values = self._split(line, tag, cells, 2 + extra, count + size * (size + 1) // 2)
        information = np.zeros((size, size))
        information[np.triu_indices(size)] = values[count:]
        information += np.triu(information, 1).T
        least, *_, most = np.linalg.eigvalsh(information)
        if least < -_ROUNDED * abs(most):
            rule = "information must have no negative eigenvalue"
            raise DataError(self.path, rule, row=line, field=tag, value=float(least))
        if numbers[0] == numbers[1]:
            raise DataError(self.path, "must join two vertices", row=line, field=tag, value=numbers[0])
        return _Edge(line, (numbers[0], numbers[1]), numbers[2] if extra else 0, values[:count], information)

    def _require_whole(self, lines: dict[int, int], fixed: set[int]) -> None:
        joined: set[int] = set()
        for tag, edges in self.edges.items():
            for edge in edges:
                for wanted, number in zip(_EDGES[tag][:2], edge.ends, strict=True):
                    if self.vertices.get(number, ("",))[0] != wanted:
                        rule = f"must join what the file has as {wanted}"
                        raise DataError(self.path, rule, row=edge.line, field=tag, value=number)
                if tag == "EDGE_SE3_TRACKXYZ" and edge.offset not in self.offsets:
                    rule = f"must name a {_OFFSET} of the file"
                    raise DataError(self.path, rule, row=edge.line, field=tag, value=edge.offset)
                joined.update(edge.ends)
        for number, (tag, _) in self.vertices.items():
            if number not in joined:
                raise DataError(self.path, "must have an edge", row=lines[number], field=tag, value=number)
        if len({tag for tag, _ in self.vertices.values()} & set(_POSES)) != 1:
            raise DataError(self.path, f"must have poses of one kind: {' or '.join(_POSES)}")
        if len(fixed) > 1 or any(self.vertices.get(number, ("",))[0] not in _POSES for number in fixed):
            rule = "may hold one pose, which is a gauge; take out the others, or give them a prior edge"
            raise DataError(self.path, rule, field=_FIX, value=sorted(fixed))


def covariance(path: PathLike, *, rotation: str = "quaternion") -> EstimateCovariance:
    """The covariance of all vertices at the estimate of a g2o file, to be asked for by their numbers.

    The edges are linearised at the vertices: give the file after its optimisation. Columns are g2o's own. Of
    SE3:QUAT: the shift in the body, then the vector part of a quaternion on the right (half angles). Of SE2:
    x, y and the angle in the world. TRACKXYZ are points; XY are keyframes of the layout that have a position
    only, and a CentroidGauge counts them. ``FIX`` of one pose is a gauge and is ignored. Robust kernels are
    not in the file.

    Parameters
    ----------
    path : text file; VERTEX_SE2, VERTEX_XY, EDGE_SE2, EDGE_SE2_XY, or VERTEX_SE3:QUAT, VERTEX_TRACKXYZ,
        EDGE_SE3:QUAT, EDGE_SE3_TRACKXYZ, PARAMS_SE3OFFSET
    rotation : what the information of EDGE_SE3:QUAT is about: "quaternion", its vector part, as g2o
        defines it, or "angle", in rad, as GTSAM reads and writes such files: the same numbers then weigh
        four times as much

    Raises
    ------
    DataError
        for a file that is missing or broken, with its line; other tags; vertices without an edge; several FIX
    DegenerateError
        where more than the three or six directions of the gauge are unobservable
    """
    return information(path, rotation=rotation).covariance()


def information(path: PathLike, *, rotation: str = "quaternion") -> Information:
    """What :func:`covariance` inverts: H, its layout and the estimate."""
    if rotation not in ROTATIONS:
        raise DataError("rotation", f"must be {' or '.join(ROTATIONS)}", value=rotation)
    graph = _Graph(path)
    of = {tag: sorted(n for n, (kind, _) in graph.vertices.items() if kind == tag) for tag in _VERTICES}
    first: dict[int, int] = {}
    values, n = {}, 0
    for tag, (count, width) in _VERTICES.items():
        values[tag] = np.reshape([graph.vertices[number][1] for number in of[tag]], (-1, count))
        first |= {number: n + width * k for k, number in enumerate(of[tag])}
        n += width * len(of[tag])
    plane = bool(of["VERTEX_SE2"])
    keys = of["VERTEX_SE2"] + of["VERTEX_XY"] if plane else of["VERTEX_SE3:QUAT"]
    columns = np.array([first[key] for key in keys])[:, None] + np.arange(3 if plane else 6)
    R: Array = np.tile(np.eye(3), (len(keys), 1, 1))
    p: Array = np.zeros((len(keys), 3))
    if plane:
        poses = len(of["VERTEX_SE2"])
        columns[poses:, 2] = -1
        R[:poses] = Rotation.from_rotvec(values["VERTEX_SE2"][:, 2:] * [0.0, 0.0, 1.0]).as_matrix()
        p[:poses, :2], p[poses:, :2] = values["VERTEX_SE2"][:, :2], values["VERTEX_XY"]
    else:
        R, p = _poses(values["VERTEX_SE3:QUAT"])
    X, point_keys = values["VERTEX_TRACKXYZ"], of["VERTEX_TRACKXYZ"]
    at = dict(
        zip([*keys, *point_keys], zip([*R, *R[:1].repeat(len(X), 0)], [*p, *X], strict=True), strict=True)
    )
    entries, rows, cols = [np.zeros(0)], [np.zeros(0, int)], [np.zeros(0, int)]
    for tag, edges in graph.edges.items():
        if not edges:
            continue
        ends = np.array([edge.ends for edge in edges])
        poses_of_ends = [
            np.array([at[key][part] for key in ends[:, end]]) for end in (0, 1) for part in (0, 1)
        ]
        with np.errstate(over="ignore", invalid="ignore"):
            J = _JACOBIANS[tag](graph, edges, *poses_of_ends, ROTATIONS[rotation])
            blocks = J.swapaxes(1, 2) @ np.array([edge.information for edge in edges]) @ J
        endless = np.flatnonzero(~(np.abs(blocks) < LARGEST).all(axis=(1, 2)))
        if endless.size:
            line = edges[int(endless[0])].line
            rule = f"must have poses and information whose products are below {LARGEST:.0e}"
            raise DataError(path, rule, row=line, field=tag)
        widths = [_VERTICES[kind][1] for kind in _EDGES[tag][:2]]
        where = np.concatenate(
            [np.array([first[k] for k in ends[:, e]])[:, None] + np.arange(widths[e]) for e in (0, 1)], axis=1
        )
        entries.append(blocks.ravel())
        rows.append(where.repeat(where.shape[1], axis=1).ravel())
        cols.append(np.tile(where, where.shape[1]).ravel())
    triplets = np.concatenate(entries), (np.concatenate(rows), np.concatenate(cols))
    parts = (
        {"position": columns[:, :2], "rotation": columns[:, 2:]}
        if plane
        else {"position": columns[:, :3], "rotation": columns[:, 3:]}
    )
    place = np.reshape([first[key] for key in point_keys], (-1, 1)).astype(np.int64) + np.arange(3)
    layout = Layout(n, parts, place, "left" if plane else "g2o", keys=keys, point_keys=point_keys)
    H = sparse.csc_array(triplets, shape=(n, n))
    return Information(0.5 * (H + H.T), layout, R, p, None, X, Euclidean(), None)


def _poses(values: Array) -> tuple[Array, Array]:
    """R (m, 3, 3) and p (m, 3) of rows x y z qx qy qz qw."""
    return Rotation.from_quat(values[:, 3:]).as_matrix().reshape(-1, 3, 3), values[:, :3]


def _se3(graph: _Graph, edges: list[_Edge], R: Array, p: Array, S: Array, q: Array, unit: float) -> Array:
    """(m, 6, 12) of the translation and the quaternion's vector part (times ``unit``) of Z^-1 X_i^-1 X_j."""
    Z, _ = _poses(np.array([edge.measured for edge in edges]))
    Z_T, between = Z.swapaxes(1, 2), np.einsum("mji,mj->mi", R, q - p)
    quaternion = Rotation.from_matrix(Z_T @ R.swapaxes(1, 2) @ S).as_quat(canonical=True)
    v, w = hat(quaternion[:, :3]), quaternion[:, 3, None, None] * np.eye(3)
    J = np.zeros((len(edges), 6, 12))
    J[:, :3, :3], J[:, :3, 3:6] = -Z_T, 2.0 * Z_T @ hat(between)
    J[:, :3, 6:9] = Z_T @ R.swapaxes(1, 2) @ S
    J[:, 3:, 3:6], J[:, 3:, 9:] = -unit * (w - v) @ Z_T, unit * (w + v)
    return J


def _trackxyz(
    graph: _Graph, edges: list[_Edge], R: Array, p: Array, _: Array, X: Array, unit: float
) -> Array:
    """(m, 3, 9) of the point in the sensor, by the pose and the point."""
    turn, _ = _poses(np.array([graph.offsets[edge.offset] for edge in edges]))
    T, seen = turn.swapaxes(1, 2), np.einsum("mji,mj->mi", R, X - p)
    return np.concatenate([-T, 2.0 * T @ hat(seen), T @ R.swapaxes(1, 2)], axis=2)


def _se2(graph: _Graph, edges: list[_Edge], R: Array, p: Array, S: Array, q: Array, unit: float) -> Array:
    """(m, 3, 6) of x, y and the angle of Z^-1 X_i^-1 X_j."""
    angle = np.array([edge.measured[2] for edge in edges])
    Z_T = Rotation.from_rotvec(-angle[:, None] * [0.0, 0.0, 1.0]).as_matrix().reshape(-1, 3, 3)[:, :2, :2]
    J = np.zeros((len(edges), 3, 6))
    by_pose = _se2_xy(graph, edges, R, p, S, q, unit)
    J[:, :2, :5] = Z_T @ by_pose
    J[:, 2, 2], J[:, 2, 5] = -1.0, 1.0
    return J


def _se2_xy(graph: _Graph, edges: list[_Edge], R: Array, p: Array, _: Array, q: Array, unit: float) -> Array:
    """(m, 2, 5) of the point in the body, by the pose and the point."""
    R_T = R[:, :2, :2].swapaxes(1, 2)
    away = (q - p)[:, :2]
    turned = np.stack([away[:, 1], -away[:, 0]], axis=1)
    return np.concatenate([-R_T, R_T @ turned[:, :, None], R_T], axis=2)


_JACOBIANS: dict[str, Any] = {
    "EDGE_SE2": _se2,
    "EDGE_SE2_XY": _se2_xy,
    "EDGE_SE3:QUAT": _se3,
    "EDGE_SE3_TRACKXYZ": _trackxyz,
}
