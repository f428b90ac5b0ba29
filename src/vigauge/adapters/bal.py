"""The covariance of a bundle adjustment in the text format "in the large" (BAL), in any gauge."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sparse
from scipy.spatial.transform import Rotation

from ..arrays import number
from ..covariance.estimate import EstimateCovariance
from ..errors import DataError
from ..gauge.group import Similarity
from ..gauge.layout import Layout
from ..geometry.camera import distort
from ..geometry.so3 import hat
from ..model.text_file import PathLike, number_in, read_text
from .information import Information

# Numbers of a camera (angle-axis, translation, f, k1, k2), an observation and a point.
_CAMERA, _OBSERVATION, _POINT = 9, 4, 3


def covariance(path: PathLike, *, sigma: float = 1.0, intrinsics: bool = True) -> EstimateCovariance:
    """The covariance of all cameras and points at the estimate of a BAL file, by their indices, from 0.

    The reprojection errors are linearised here, all with the same weight: give the file after its
    adjustment. Columns of a camera: its centre and its rotation in the world (left increments, m, rad), and
    then "intrinsics": f, k1, k2. R_WB turns from BAL's camera, which looks along -z, into the world. The
    scale is open too, so a gauge is a pair: ``(vg.KeyframeGauge(0), vg.Distance(0, 1))``.

    Parameters
    ----------
    path : text file: cameras, points, observations; then camera, point, x, y of each; 9 numbers a camera
        (angle-axis, translation, f, k1, k2), 3 a point
    sigma : standard deviation of x and y, pixels
    intrinsics : whether f, k1 and k2 are estimated, as BAL does, or known

    Raises
    ------
    DataError
        for a file that is missing or broken, with its line, and for a camera or a point with less than two
        observations
    DegenerateError
        where more than the seven directions of the gauge are unobservable
    """
    return information(path, sigma=sigma, intrinsics=intrinsics).covariance()


def information(path: PathLike, *, sigma: float = 1.0, intrinsics: bool = True) -> Information:
    """What :func:`covariance` inverts: H, its layout and the estimate."""
    sigma = number("sigma", sigma, above=0.0)
    values, rows = _numbers(path)
    counts = values[:3]
    for name, count, row in zip(("cameras", "points", "observations"), counts, rows, strict=False):
        if count < 1 or count != round(count):
            raise DataError(
                path, "must be a whole number, 1 or more", row=int(row), field=name, value=float(count)
            )
    cameras, points, seen = (int(count) for count in counts)
    wanted = 3 + _OBSERVATION * seen + _CAMERA * cameras + _POINT * points
    if len(values) != wanted:
        raise DataError(path, f"must have {wanted} numbers, as its first line says", value=len(values))
    head, tail = 3 + _OBSERVATION * seen, wanted - _POINT * points
    observations = values[3:head].reshape(-1, _OBSERVATION)
    for column, (name, count) in enumerate({"camera": cameras, "point": points}.items()):
        index = observations[:, column]
        bad = np.flatnonzero((index < 0) | (index >= count) | (index != np.round(index)))
        if bad.size:
            row = int(rows[3 + _OBSERVATION * bad[0] + column])
            raise DataError(
                path, f"must be an index in 0..{count - 1}", row=row, field=name, value=float(index[bad[0]])
            )
        few = np.flatnonzero(np.bincount(index.astype(np.int64), minlength=count) < 2)
        if few.size:
            row = int(rows[head + _CAMERA * few[0]] if name == "camera" else rows[tail + _POINT * few[0]])
            raise DataError(path, "must have two observations", row=row, field=f"{name} {few[0]}")
    i, k = observations[:, :2].T.astype(np.int64)
    given, X = values[head:tail].reshape(-1, _CAMERA), values[tail:].reshape(-1, _POINT)
    R = Rotation.from_rotvec(given[:, :3]).as_matrix().reshape(-1, 3, 3).swapaxes(1, 2)
    p = -np.einsum("nij,nj->ni", R, given[:, 3:6])
    R_T, away = R[i].swapaxes(1, 2), X[k] - p[i]
    x, y, z = P = np.einsum("mij,mj->im", R_T, away)
    flat = np.flatnonzero(z == 0.0)
    if flat.size:
        row = int(rows[3 + _OBSERVATION * flat[0]])
        raise DataError(path, "point must not lie in the plane of its camera", row=row, value=int(k[flat[0]]))
    f, k1, k2 = given[i, 6:].T
    xy = -P[:2].T / z[:, None]
    none: Any = np.zeros(seen)
    distorted, slope = distort(xy, (k1, k2, none, none))
    by_P = np.zeros((seen, 2, 3))
    by_P[:, 0, 0] = by_P[:, 1, 1] = -1.0 / z
    by_P[:, :, 2] = P[:2].T / z[:, None] ** 2
    D = f[:, None, None] * (slope @ by_P) @ R_T
    r2 = np.sum(xy**2, axis=1)[:, None]
    own = np.stack([distorted, f[:, None] * r2 * xy, f[:, None] * r2**2 * xy], axis=2)
    J = np.concatenate([-D, D @ hat(away), *([own] if intrinsics else []), D], axis=2) / sigma
    kinds = ["position", "rotation", *(["intrinsics:3"] if intrinsics else [])]
    layout = Layout.by_keyframe(cameras, kinds, points=points)
    width = layout.points[0, 0] // cameras
    columns = np.concatenate([width * i[:, None] + np.arange(width), layout.points[k]], axis=1)
    triplets = J.ravel(), np.repeat(columns, 2, axis=0).ravel(), (width + 3) * np.arange(2 * seen + 1)
    jacobian = sparse.csr_array(triplets, shape=(2 * seen, layout.n))
    return Information((jacobian.T @ jacobian).tocsc(), layout, R, p, None, X, Similarity(), None)


def _numbers(path: PathLike) -> tuple[np.ndarray, np.ndarray]:
    """All numbers of a file, and the line of each."""
    lines = [text.split() for text in read_text(path).splitlines()]
    rows = np.repeat(np.arange(1, len(lines) + 1), [len(cells) for cells in lines])
    cells = [cell for line in lines for cell in line]
    values = [number_in(path, int(row), cell) for row, cell in zip(rows, cells, strict=True)]
    if len(values) < 3 or rows[2] != rows[0]:
        raise DataError(path, "must start with the numbers of cameras, points and observations", row=1)
    return np.array(values), rows
