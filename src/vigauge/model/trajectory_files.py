"""Trajectories on disk: TUM for other tools, CSV with standard deviations, npz with everything."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import DataError
from ..files import write_rows, write_text
from ..geometry.so3 import Array
from .archive import load_arrays, save_arrays
from .foreign_trajectories import FOREIGN, ROS_POSITION, quaternions, read_openvins, read_ros, rotations
from .text_file import PathLike, integer_in, nanoseconds_in, number_in, read_text, require_after, require_unit
from .trajectory import AXES, Trajectory, trajectory_of

_KIND = "trajectory"
_QUATERNION = ("qx", "qy", "qz", "qw")
_TEXTS = ("frame", "side", "gauge")
_SUFFIX_OF = {"m": "m", "rad": "rad", "m/s": "mps"}


def _columns(kind: str, prefix: str = "") -> list[str]:
    axes, unit = AXES[kind]
    return [f"{prefix}{axis}_{_SUFFIX_OF[unit]}" for axis in axes]


def save_trajectory(
    path: PathLike,
    estimate: object,
    covariance: Array | None = None,
    *,
    times_ns: object = None,
    gauge: object = "",
    frame: str = "W",
    side: str = "left",
    kinds: Sequence[str] | None = None,
    keys: Sequence[object] | None = None,
    format: str = "",
) -> None:
    """Write an estimate, with its covariance where the format has a place for it; the ending says which.

    ``.tum``, ``.txt``: rows t x y z qx qy qz qw (s, m; body to world), poses only, for evo and others.
    ``.csv``: a row for each keyframe, units in the names of columns, standard deviations, frame, side and
    gauge. ``.npz``: everything, with named axes and units.

    Parameters
    ----------
    estimate : State, Solution, Trajectory, poses (N, 4, 4), arrays (R_WB, p_W) or (R_WB, p_W, v_W), or a
        Covariance or EstimateCovariance: its poses, and with ``gauge`` their covariances in that gauge
    covariance : (N, 6, 6) of (position, rotation) or (N, 9, 9) with velocity: m, rad, m/s. With a State as
        ``Covariance.keyframes`` gives it; the file has the left increment of the first rotation too
    times_ns : (N,) integers, increasing; TUM needs them
    gauge : the gauge of the covariance, or its name
    frame : name of the world frame
    side : of the rotation's increments in the covariance, "left" (in W) or "right" (in B)
    kinds : what the covariance has, where that is something else: "position", "rotation", "velocity"
    keys : names of the keyframes, for .csv and .npz; those of an EstimateCovariance, or 0, 1, ...
    format : of another program: "ros", a .csv as ``rostopic echo -p`` prints PoseWithCovarianceStamped
        (x, y, z, then turns about the world's axes), or "openvins", a .txt for its ``ov_eval`` (turns in B;
        the covariances of rotation and position, not those between them). Neither names the gauge

    Raises DataError for another ending, a covariance without a gauge or in a TUM file, times that do not
    increase, and shapes that do not fit; OutputError where the file cannot be written.
    """
    write, _ = _format(path)
    if format:
        suffix = Path(path).suffix.lower()
        if (format, suffix) not in FOREIGN:
            rule = f"must be one of {', '.join(' for '.join(pair) for pair in FOREIGN)}"
            raise DataError("format", rule, value=f"{format} for {suffix}")
        write = FOREIGN[format, suffix]
    write(
        path,
        trajectory_of(
            estimate,
            covariance,
            times_ns=times_ns,
            gauge=gauge,
            frame=frame,
            side=side,
            kinds=kinds,
            keys=keys,
        ),
    )


def load_trajectory(path: PathLike, *, gauge: str = "", deviations: PathLike | None = None) -> Trajectory:
    """Read a trajectory: what :func:`save_trajectory` wrote, any TUM file, or one of ROS or OpenVINS.

    A TUM file has poses and times only; a CSV file ``sigma`` but no ``covariance``. Known by their columns
    are a .csv of ``rostopic echo -p`` (PoseWithCovarianceStamped or Odometry: poses and covariances), and, in
    a .txt, the state file of OpenVINS (poses, velocities) and the rows of its ``ov_eval`` (poses, sigmas).
    OpenVINS' turns are in B: ``side`` is "right".

    Parameters
    ----------
    gauge : name of the gauge of a covariance of ROS or OpenVINS, which their files do not tell
    deviations : file of standard deviations that belongs to a state file of OpenVINS

    Raises DataError, with the line, for a file that is missing or broken, and for a gauge that is not named,
    or named where the file has its own.
    """
    _, read = _format(path)
    try:
        if (foreign := _foreign(path)) is not None:
            return foreign(path, gauge, deviations)
        for name, given in {"gauge": gauge, "deviations": deviations}.items():
            if given:
                raise DataError(path, "must not be given: it is for files of ROS and OpenVINS", field=name)
        return read(path)
    except DataError as error:
        if error.file == str(path):
            raise
        rule = f"{error.file}: {error.rule}"
        raise DataError(path, rule, row=error.row, field=error.field, value=error.value) from error


def _write_tum(path: PathLike, trajectory: Trajectory) -> None:
    if trajectory.sigma is not None:
        raise DataError(path, "TUM has no place for a covariance; write a .csv or .npz file beside it")
    if trajectory.times_ns is None:
        raise DataError(path, "TUM needs times: give times_ns=", field="times_ns")
    lines = ["# timestamp tx ty tz qx qy qz qw"]
    values = np.concatenate([trajectory.p_W, quaternions(trajectory)], axis=1).tolist()
    for t, row in zip(trajectory.times_ns.tolist(), values, strict=True):
        # By decimals: as a float a stamp would lose 200 ns.
        lines.append(" ".join([f"{Decimal(t).scaleb(-9):.9f}", *map(repr, row)]))
    write_text(path, "\n".join(lines) + "\n")


def _read_tum(path: PathLike) -> Trajectory:
    times, values = [], []
    for line, text in enumerate(read_text(path).splitlines(), start=1):
        cells = text.split()
        if not cells or cells[0].startswith("#"):
            continue
        if len(cells) != 8:
            raise DataError(path, "must have 8 columns t x y z qx qy qz qw", row=line, value=len(cells))
        times.append(nanoseconds_in(path, line, cells[0]))
        values.append([number_in(path, line, cell) for cell in cells[1:]])
        require_after(path, line, times)
        require_unit(path, line, values[-1][3:])
    rows = np.array(values).reshape(-1, 7)
    return Trajectory(rows[:, :3], rotations(rows[:, 3:]), times_ns=np.array(times, dtype=np.int64))


def _write_csv(path: PathLike, trajectory: Trajectory) -> None:
    names = ["keyframe"] + ["t_ns"] * (trajectory.times_ns is not None) + _columns("position")
    names += _QUATERNION
    count = len(trajectory.p_W)
    named: Any = np.arange(count) if trajectory.keys is None else np.array(trajectory.keys, dtype=object)
    parts: list[Any] = [named[:, None]]
    if trajectory.times_ns is not None:
        parts.append(trajectory.times_ns[:, None])
    parts += [trajectory.p_W, quaternions(trajectory)]
    if trajectory.v_W is not None:
        names += _columns("velocity")
        parts.append(trajectory.v_W)
    if trajectory.sigma is not None:
        names += [name for kind in trajectory.kinds for name in _columns(kind, "sigma_")]
        parts.append(trajectory.sigma)
    texts = {name: getattr(trajectory, name) for name in _TEXTS}
    columns = [column for part in parts for column in part.T.tolist()]
    rows = [dict(zip(names, row, strict=True)) | texts for row in zip(*columns, strict=True)]
    if not rows:
        raise DataError(path, "a CSV file must have a keyframe at least")
    write_rows(path, rows)


def _rows_of_csv(path: PathLike) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Names of the columns, and line and cells of every row, one a name."""
    reader = csv.reader(read_text(path).splitlines())
    try:
        header, *rows = [(reader.line_num, row) for row in reader if row] or [(1, [])]
    except csv.Error as error:
        raise DataError(path, f"must be comma-separated: {error}", row=reader.line_num) from error
    names = header[1]
    if len(set(names)) != len(names):
        raise DataError(path, "columns must have different names", row=header[0], value=names)
    for line, row in rows:
        if len(row) != len(names):
            raise DataError(path, f"must have {len(names)} columns", row=line, value=len(row))
    if not rows:
        raise DataError(path, "must have a header and a keyframe at least")
    return names, rows


def _read_csv(path: PathLike) -> Trajectory:
    names, rows = _rows_of_csv(path)
    cells = {name: [(line, row[at]) for line, row in rows] for at, name in enumerate(names)}

    def numbers(wanted: Sequence[str]) -> Array:
        missing = [name for name in wanted if name not in cells]
        if missing:
            raise DataError(path, "column must be present", field=missing[0])
        return np.array(
            [[number_in(path, line, cell, name) for line, cell in cells[name]] for name in wanted]
        ).T

    kinds = tuple(kind for kind in AXES if _columns(kind, "sigma_")[0] in cells)
    times = None
    if "t_ns" in cells:
        stamps: list[int] = []
        for line, cell in cells["t_ns"]:
            stamps.append(integer_in(path, line, cell))
            require_after(path, line, stamps)
        times = np.array(stamps, dtype=np.int64)
    quaternions = numbers(_QUATERNION)
    for (line, _), quaternion in zip(rows, quaternions.tolist(), strict=True):
        require_unit(path, line, quaternion)
    return Trajectory(
        numbers(_columns("position")),
        rotations(quaternions),
        v_W=numbers(_columns("velocity")) if _columns("velocity")[0] in cells else None,
        times_ns=times,
        sigma=numbers([name for kind in kinds for name in _columns(kind, "sigma_")]) if kinds else None,
        kinds=kinds,
        keys=_keys([key for _, key in cells["keyframe"]]) if "keyframe" in cells else None,
        **{name: _same(path, name, cells.get(name)) for name in _TEXTS},  # type: ignore[arg-type]
    )


def _keys(names: list[str]) -> tuple[str, ...] | None:
    return None if names == [str(place) for place in range(len(names))] else tuple(names)


def _same(path: PathLike, name: str, cells: list[tuple[int, str]] | None) -> str:
    """The one text of a column; DataError where rows differ."""
    if cells is None:
        raise DataError(path, "column must be present", field=name)
    for line, cell in cells:
        if cell != cells[0][1]:
            rule = f"must be {cells[0][1]!r}, as in the first row"
            raise DataError(path, rule, row=line, field=name, value=cell)
    return cells[0][1]


def _write_npz(path: PathLike, trajectory: Trajectory) -> None:
    arrays = {name: getattr(trajectory, name) for name in ("p_W", "R_WB", "v_W", "times_ns", "sigma")}
    arrays |= {"covariance": trajectory.covariance, "kind": _KIND}
    arrays |= {name: getattr(trajectory, name) for name in _TEXTS}
    arrays |= {name: np.array(getattr(trajectory, name), dtype="U") for name in ("kinds", "axes", "units")}
    if trajectory.keys is not None:
        arrays["keys"] = np.array(trajectory.keys, dtype="U")
    save_arrays(path, {name: np.asarray(value) for name, value in arrays.items() if value is not None})


def _read_npz(path: PathLike) -> Trajectory:
    arrays = load_arrays(path)
    found = str(arrays.get("kind", ""))
    if found != _KIND:
        raise DataError(path, f"must hold a {_KIND}", field="kind", value=found)
    for name in ("p_W", "R_WB", "kinds", *_TEXTS):
        if name not in arrays:
            raise DataError(path, "array must be present", field=name)
    lists = ("kinds", "keys")
    for name in ("kinds", *_TEXTS, *(["keys"] if "keys" in arrays else [])):
        if arrays[name].dtype.kind != "U" or arrays[name].ndim != (name in lists):
            rule = "must be a list of names" if name in lists else "must be one text"
            raise DataError(path, rule, field=name, value=arrays[name])
    numbers = ("p_W", "R_WB", "v_W", "times_ns", "covariance", "sigma")
    return Trajectory(
        kinds=tuple(map(str, arrays["kinds"])),
        keys=tuple(map(str, arrays["keys"])) if "keys" in arrays else None,
        **{name: str(arrays[name]) for name in _TEXTS},  # type: ignore[arg-type]
        **{name: arrays[name] for name in numbers if name in arrays},  # type: ignore[arg-type]
    )


def _foreign(path: PathLike) -> Callable[[PathLike, str, PathLike | None], Trajectory] | None:
    """The reader of another program's file, by its columns."""
    suffix = Path(path).suffix.lower()
    if suffix not in (".csv", ".txt"):
        return None
    rows = (row for row in read_text(path).splitlines() if row.strip() and not row.startswith("#"))
    first = next(rows, "")
    if suffix == ".csv":
        return read_ros if ROS_POSITION in first.split(",") else None
    return read_openvins if len(first.split()) >= 17 else None


_Format = tuple[Callable[[PathLike, Trajectory], None], Callable[[PathLike], Trajectory]]
_FORMATS: dict[str, _Format] = {
    ".tum": (_write_tum, _read_tum),
    ".txt": (_write_tum, _read_tum),
    ".csv": (_write_csv, _read_csv),
    ".npz": (_write_npz, _read_npz),
}


def _format(path: PathLike) -> _Format:
    suffix = Path(path).suffix.lower()
    if suffix not in _FORMATS:
        raise DataError(path, f"must end in {', '.join(_FORMATS)}", field="suffix", value=suffix)
    return _FORMATS[suffix]
