"""The covariance of a Ceres problem in any gauge, from the Jacobian that ``Problem::Evaluate`` gives."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sparse

from ..arrays import integer, integers, reals
from ..covariance.estimate import EstimateCovariance
from ..covariance.information import from_jacobian
from ..errors import DataError
from ..gauge.group import Group
from ..gauge.layout import Layout
from ..geometry.so3 import Array
from ..model.text_file import PathLike, number_in, read_text

_FILES = {"rows": np.int32, "cols": np.int32, "values": np.float64}


def covariance(
    folder: PathLike,
    layout: Layout,
    poses: object,
    velocities: Array | None = None,
    points: Array | None = None,
    *,
    group: Group | None = None,
    gravity: object = None,
    vectors: Mapping[str, Array] | None = None,
) -> EstimateCovariance:
    """The covariance from a ``CRSMatrix`` that was written to files as it is in memory.

    The C++ that writes them is in "From your estimator". Ceres applies robust losses to the rows itself.
    Columns are by the tangents of ``EvaluateOptions::parameter_blocks``, in its order: quaternions of body to
    world with a QuaternionManifold or EigenQuaternionManifold are ``side="ceres"`` (half angles in W).

    Parameters
    ----------
    folder : has rows.bin and cols.bin (int32), values.bin (double), or the same numbers in .txt
    layout : what the columns stand for
    poses, velocities, points, group, gravity, vectors : as :func:`vigauge.null_space` takes them

    Raises
    ------
    DataError
        for files that are missing or do not fit each other or the layout, and for poses that are not those of
        the Jacobian
    DegenerateError
        where more than the group is unobservable
    """
    J = read_jacobian(folder, layout.n)
    estimate: dict[str, Any] = {"group": group, "gravity": gravity, "vectors": vectors}
    return from_jacobian(J, layout, poses, velocities, points, **estimate)


def read_jacobian(folder: PathLike, n: int) -> Any:
    """(m, n) sparse, of the files that :func:`covariance` reads; ``vg.audit`` takes ``J.T @ J``.

    Raises DataError for files that are missing or do not fit each other or ``n``.
    """
    rows, cols, values = (_read(Path(folder) / name, np.dtype(kind)) for name, kind in _FILES.items())
    try:
        return jacobian(rows, cols, values, n)
    except DataError as error:
        raise DataError(folder, f"{error.file}: {error.rule}", row=error.row, value=error.value) from error


def jacobian(rows: object, cols: object, values: object, n: int) -> Any:
    """(m, n) sparse, of the arrays of a ``CRSMatrix``: the start of each row, columns, values.

    Raises DataError for arrays that are not of that form, and for another number of columns.
    """
    n = integer("n", n)
    starts, columns = integers("rows", rows, ("m",)), integers("cols", cols, ("k",))
    entries = reals("values", values, (len(columns),), matrix=True)
    if not len(starts) or starts[0] != 0 or starts[-1] != len(columns) or np.any(np.diff(starts) < 0):
        last = int(starts[-1]) if len(starts) else None
        raise DataError("rows", f"must increase from 0 to {len(columns)}, the length of cols", value=last)
    if len(columns) and not (columns.min() >= 0 and columns.max() < n):
        worst = int(columns.max()) if columns.max() >= n else int(columns.min())
        rule = f"must lie in 0..{n - 1}: the layout has {n} columns, as many as the tangents of all blocks"
        raise DataError("cols", rule, value=worst)
    return sparse.csr_array((entries, columns, starts), shape=(len(starts) - 1, n))


def _read(name: Path, kind: np.dtype[Any]) -> np.ndarray:
    path, text = name.with_suffix(".bin"), name.with_suffix(".txt")
    if not path.is_file() and text.is_file():
        return _read_text(text, kind)
    if not path.is_file():
        raise DataError(path, "file must exist, or the same numbers as .txt")
    size = path.stat().st_size
    if size % kind.itemsize:
        rule = f"must hold whole numbers of {kind.itemsize} bytes ({kind.name}); its end is missing"
        raise DataError(path, rule, value=f"{size} bytes")
    return np.fromfile(path, kind)


def _read_text(path: Path, kind: np.dtype[Any]) -> np.ndarray:
    out = []
    for line, text in enumerate(read_text(path).splitlines(), start=1):
        for cell in text.split():
            out.append(number_in(path, line, cell))
            if kind.kind == "i" and not (out[-1].is_integer() and abs(out[-1]) <= np.iinfo(kind).max):
                raise DataError(path, f"must be an integer of {8 * kind.itemsize} bits", row=line, value=cell)
    return np.array(out).astype(kind)
