"""Trajectories in the columns of other programs: ROS' PoseWithCovariance and OpenVINS."""

from __future__ import annotations

import csv
from collections.abc import Callable
from decimal import Decimal
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import DataError
from ..files import write_rows, write_text
from ..geometry.charts import as_convention
from ..geometry.so3 import Array
from .text_file import PathLike, integer_in, nanoseconds_in, number_in, read_text, require_after, require_unit
from .trajectory import Trajectory

_POSE = ("position", "rotation")
_STAMP, _FRAME = "field.header.stamp", "field.header.frame_id"
_ROS_POSE = [f"field.pose.pose.position.{axis}" for axis in "xyz"]
_ROS_POSE += [f"field.pose.pose.orientation.{axis}" for axis in "xyzw"]
ROS_POSITION = _ROS_POSE[0]
_ROS_COVARIANCE = [f"field.pose.covariance{k}" for k in range(36)]
# Columns of ov_eval's rows, with a covariance, and those of a state file's that are read; more follow there.
_EVALUATED, _STATE, _DEVIATIONS = 20, 17, 16
_UPPER = np.triu_indices(3)


def _write_ros(path: PathLike, trajectory: Trajectory) -> None:
    C, times = _pose_covariance(path, trajectory, "ros")
    values = np.concatenate([trajectory.p_W, quaternions(trajectory), C.reshape(-1, 36)], axis=1).tolist()
    rows = [
        {"%time": t, "field.header.seq": k, _STAMP: t, _FRAME: trajectory.frame}
        | dict(zip(_ROS_POSE + _ROS_COVARIANCE, row, strict=True))
        for k, (t, row) in enumerate(zip(times, values, strict=True))
    ]
    write_rows(path, rows)


def _write_openvins(path: PathLike, trajectory: Trajectory) -> None:
    C, times = _pose_covariance(path, trajectory, "right")
    lines = [
        "# timestamp(s) tx ty tz qx qy qz qw Pr11 Pr12 Pr13 Pr22 Pr23 Pr33 Pt11 Pt12 Pt13 Pt22 Pt23 Pt33"
    ]
    turns, shifts = C[:, 3:, 3:], C[:, :3, :3]
    parts = [trajectory.p_W, quaternions(trajectory), turns[:, *_UPPER], shifts[:, *_UPPER]]
    for t, row in zip(times, np.concatenate(parts, axis=1).tolist(), strict=True):
        lines.append(" ".join([f"{Decimal(t).scaleb(-9):.9f}", *map(repr, row)]))
    write_text(path, "\n".join(lines) + "\n")


FOREIGN: dict[tuple[str, str], Callable[[PathLike, Trajectory], None]] = {
    ("ros", ".csv"): _write_ros,
    ("openvins", ".txt"): _write_openvins,
}


def _pose_covariance(path: PathLike, trajectory: Trajectory, to: str) -> tuple[Array, list[int]]:
    """(N, 6, 6) covariances of poses by a convention, and times, ns."""
    if trajectory.covariance is None or trajectory.kinds[:2] != _POSE:
        raise DataError(path, "must have the covariance of poses, positions first", value=trajectory.kinds)
    if trajectory.times_ns is None or not len(trajectory.times_ns):
        raise DataError(path, "must have a keyframe at least, and times: give times_ns=", field="times_ns")
    C = trajectory.covariance[:, :6, :6]
    return as_convention(C, trajectory.R_WB, source=trajectory.side, to=to), trajectory.times_ns.tolist()


def read_ros(path: PathLike, gauge: str, deviations: PathLike | None) -> Trajectory:
    """Poses and covariances of what ``rostopic echo -p`` prints."""
    if deviations is not None:
        raise DataError(path, "has its covariances itself", field="deviations", value=str(deviations))
    reader = csv.reader(read_text(path).splitlines())
    names, *rows = ((reader.line_num, row) for row in reader if row)
    at = {name: k for k, name in enumerate(names[1])}
    for name in (_STAMP, _FRAME, *_ROS_POSE, *_ROS_COVARIANCE):
        if name not in at:
            raise DataError(path, "column must be present", field=name)
    times: list[int] = []
    values: list[list[float]] = []
    frames: list[str] = []
    for line, row in rows:
        if len(row) != len(names[1]):
            raise DataError(path, f"must have {len(names[1])} columns", row=line, value=len(row))
        times.append(integer_in(path, line, row[at[_STAMP]], _STAMP))
        require_after(path, line, times)
        wanted = _ROS_POSE + _ROS_COVARIANCE
        values.append([number_in(path, line, row[at[name]], name) for name in wanted])
        require_unit(path, line, values[-1][3:7])
        frames.append(row[at[_FRAME]])
        if frames[-1] != frames[0]:
            rule = f"must be {frames[0]!r}, as in the first row"
            raise DataError(path, rule, row=line, field=_FRAME, value=frames[-1])
    if not rows:
        raise DataError(path, "must have a header and a keyframe at least")
    numbers = np.array(values)
    C = numbers[:, 7:].reshape(-1, 6, 6)
    if np.any(C[:, 0, 0] == -1.0) or not C.any():
        raise DataError(path, "has unknown covariances (-1 or zeros); write the poses as .tum")
    return Trajectory(
        numbers[:, :3],
        rotations(numbers[:, 3:7]),
        times_ns=np.array(times, dtype=np.int64),
        covariance=C,
        kinds=_POSE,
        gauge=_required(path, gauge),
        frame=frames[0],
    )


def read_openvins(path: PathLike, gauge: str, deviations: PathLike | None) -> Trajectory:
    """A state file with or without its deviations, or rows of ov_eval."""
    times, rows, lines = _rows(path)
    given: dict[str, Any] = {"times_ns": np.array(times, dtype=np.int64), "side": "right"}
    if rows.shape[1] == _EVALUATED - 1:
        if deviations is not None:
            raise DataError(path, "has its covariances itself", field="deviations", value=str(deviations))
        _require_units(path, lines, rows[:, 3:7])
        variances = rows[:, [13, 16, 18, 7, 10, 12]]
        if np.any(variances < 0.0):
            line = lines[int(np.argmin(variances.min(axis=1)))]
            raise DataError(path, "variances must not be negative", row=line, value=float(variances.min()))
        given |= {"sigma": np.sqrt(variances), "kinds": _POSE, "gauge": _required(path, gauge)}
        return Trajectory(rows[:, :3], rotations(rows[:, 3:7]), **given)
    if rows.shape[1] < _STATE - 1:
        raise DataError(path, f"must have {_STATE} columns or more", row=lines[0], value=rows.shape[1] + 1)
    _require_units(path, lines, rows[:, :4])
    if deviations is not None:
        theirs, sigma, at = _rows(deviations)
        if sigma.shape[1] < _DEVIATIONS - 1:
            rule = f"must have {_DEVIATIONS} columns or more"
            raise DataError(deviations, rule, row=at[0], value=sigma.shape[1] + 1)
        if theirs != times:
            wrong = next((k for k, (a, b) in enumerate(zip(times, theirs, strict=False)) if a != b), -1)
            raise DataError(deviations, f"must have the times of {path}", row=at[wrong], value=theirs[wrong])
        sigma = sigma[:, [3, 4, 5, 0, 1, 2, 6, 7, 8]]
        given |= {"sigma": sigma, "kinds": (*_POSE, "velocity"), "gauge": _required(path, gauge)}
    elif gauge:
        raise DataError(path, "has no covariance: give the file of deviations=", field="gauge", value=gauge)
    # JPL's quaternion of world to body has the numbers of Hamilton's of body to world.
    return Trajectory(rows[:, 4:7], rotations(rows[:, :4]), v_W=rows[:, 7:10], **given)


def _rows(path: PathLike) -> tuple[list[int], Array, list[int]]:
    """Times, ns, the other numbers of each row, and the lines."""
    times: list[int] = []
    values: list[list[float]] = []
    lines: list[int] = []
    for line, text in enumerate(read_text(path).splitlines(), start=1):
        cells = text.split()
        if not cells or cells[0].startswith("#"):
            continue
        if values and len(cells) != len(values[0]) + 1:
            raise DataError(path, f"must have {len(values[0]) + 1} columns", row=line, value=len(cells))
        times.append(nanoseconds_in(path, line, cells[0]))
        require_after(path, line, times)
        values.append([number_in(path, line, cell) for cell in cells[1:]])
        lines.append(line)
    if not values:
        raise DataError(path, "must have a keyframe at least")
    return times, np.array(values), lines


def _require_units(path: PathLike, lines: list[int], quaternions: Array) -> None:
    for line, quaternion in zip(lines, quaternions.tolist(), strict=True):
        require_unit(path, line, quaternion)


def _required(path: PathLike, gauge: str) -> str:
    if not gauge:
        rule = 'must be named, as the file has none: gauge="first" for a filter that starts at a known pose'
        raise DataError(path, rule, field="gauge")
    return gauge


def quaternions(trajectory: Trajectory) -> Array:
    """(N, 4) x, y, z, w with w not negative."""
    out: Array = Rotation.from_matrix(trajectory.R_WB).as_quat(canonical=True).reshape(-1, 4)
    return out


def rotations(quaternions: Array) -> Array:
    """(N, 3, 3) of quaternions x, y, z, w."""
    out: Array = Rotation.from_quat(quaternions).as_matrix().reshape(-1, 3, 3)
    return out
