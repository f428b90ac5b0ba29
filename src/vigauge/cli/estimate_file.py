"""What `vigauge covariance` and `vigauge diagnose` are asked about: a problem, or an information matrix."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse

from vigauge.adapters import bal, g2o
from vigauge.adapters.information import Information
from vigauge.arrays import integers, reals
from vigauge.errors import DataError, SolverError
from vigauge.gauge.gauges import FreeGauge
from vigauge.gauge.group import Euclidean, Group, Similarity, YawTranslation
from vigauge.gauge.layout import Layout
from vigauge.model.archive import load_arrays, load_problems
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.levenberg_marquardt import solve

# Exit status where the answer is that a covariance would mean nothing.
EXIT_WITHHELD = 1

_GROUPS: dict[str, Group] = {
    "yaw-translation": YawTranslation(),
    "euclidean": Euclidean(),
    "similarity": Similarity(),
}
# Flags about the files of one kind, by its suffix.
_FLAGS = {"sigma": ".txt", "known_intrinsics": ".txt", "rotation": ".g2o"}
_MOVING = ("position", "rotation", "velocity")
_HELP = """\
FILE is what vg.save_problems writes, a pose graph (.g2o) or bundle adjustment in the large (BAL, .txt) after
its optimisation, or an .npz archive with an information matrix:
  H                        (n, n), without damping; or its CSR parts H_data, H_indices, H_indptr
  position, rotation,      (N, 3) columns of H of each keyframe; -1 where it has none;
  velocity                 velocity may be left out, and so may all that follows but R_WB and p_W
  other.NAME               (N, c) columns of what does not move with the gauge, such as biases
  points                   (K, 3) columns of landmarks
  side                     text: left, right, gtsam, se3, colmap, ceres, g2o, as in vg.Layout; default left
  R_WB, p_W, v_W, X_W      the estimate: (N, 3, 3), (N, 3), (N, 3), (K, 3)
  group                    text: yaw-translation (default), euclidean, similarity
  gravity                  (3,) direction in W; default (0, 0, -1)
  times_ns                 (N,) integer nanoseconds
Keyframes of a .g2o are named by the numbers of their vertices; the output has them in increasing order.
Cameras of a .txt count from 0; R_WB turns from BAL's camera, which looks along -z, into the world.

exit status: 0, 1 where the covariance is withheld, 2 for bad input, 70 for a defect of the program"""


def add_arguments(arguments: argparse.ArgumentParser) -> None:
    arguments.formatter_class = argparse.RawDescriptionHelpFormatter
    arguments.epilog = _HELP
    arguments.add_argument("file", type=Path, metavar="FILE", help=".npz, .g2o or .txt, see below")
    arguments.add_argument(
        "--problem", type=int, default=0, metavar="I", help="number of the problem in the file; default: 0"
    )
    arguments.add_argument(
        "--at-start",
        action="store_true",
        help="use the state that the problem starts from; default: solve first",
    )
    arguments.add_argument(
        "--sigma",
        type=float,
        metavar="PIXELS",
        help="standard deviation of x and y in a .txt; default: 1",
    )
    arguments.add_argument(
        "--known-intrinsics",
        action="store_true",
        default=None,
        help="treat f, k1, k2 of a .txt as known; default: estimated",
    )
    arguments.add_argument(
        "--rotation",
        choices=g2o.ROTATIONS,
        help="what the information of EDGE_SE3:QUAT in a .g2o is about: the quaternion's vector part, as g2o"
        " defines it (default), or the angle, as GTSAM writes such files",
    )


def read_named(options: argparse.Namespace) -> Problem | Information:
    """What the arguments of :func:`add_arguments` ask about; DataError also for a flag of other files."""
    path = options.file
    given = {name: value for name in _FLAGS if (value := getattr(options, name)) is not None}
    for name in given:
        if path.suffix.lower() != _FLAGS[name]:
            flag = f"--{name.replace('_', '-')}"
            raise DataError(flag, f"is about {_FLAGS[name]} files; leave it out", value=str(path))
    return read(path, options.problem, **given)


def read(
    path: Path,
    number: int,
    *,
    sigma: float = 1.0,
    known_intrinsics: bool = False,
    rotation: str = "quaternion",
) -> Problem | Information:
    """A problem or an information matrix; DataError for a file with neither, or a broken one."""
    suffix = path.suffix.lower()
    if suffix == ".g2o":
        return g2o.information(path, rotation=rotation)
    if suffix == ".txt":
        return bal.information(path, sigma=sigma, intrinsics=not known_intrinsics)
    arrays = load_arrays(path)
    if "kind" in arrays:
        problems = load_problems(path)
        if not 0 <= number < len(problems):
            raise DataError(path, f"has {len(problems)} problems, from 0", field="--problem", value=number)
        return problems[number]
    try:
        return _information(arrays)
    except DataError as error:
        rule = f"{error.file}: {error.rule}"
        raise DataError(path, rule, row=error.row, field=error.field, value=error.value) from error


def state_of(problem: Problem, *, at_start: bool) -> State:
    """The estimate; SolverError where the run does not converge."""
    if at_start:
        return problem.initial
    solution = solve(problem, FreeGauge())
    if not solution.converged:
        raise SolverError(
            f"the run did not converge ({solution.status}): no estimate; --at-start asks at the start"
        )
    return solution.state


def _information(arrays: Mapping[str, np.ndarray]) -> Information:
    arrays = dict(arrays)
    H = _matrix(arrays)
    names = [name for name in arrays if name in _MOVING or name.startswith("other.")]
    blocks = {name.removeprefix("other."): arrays.pop(name) for name in names}
    layout = Layout(
        H.shape[0], blocks, arrays.pop("points", np.empty((0, 3), np.int64)), _text(arrays, "side", "left")
    )
    group = _text(arrays, "group", "yaw-translation")
    if group not in _GROUPS:
        raise DataError("group", f"must be one of {', '.join(_GROUPS)}", value=group)
    R, p = (_needed(arrays, name) for name in ("R_WB", "p_W"))
    velocities, times = arrays.pop("v_W", None), arrays.pop("times_ns", None)
    if velocities is not None:
        velocities = reals("v_W", velocities, (layout.n_keyframes, 3))
    if times is not None:
        times = integers("times_ns", times, (layout.n_keyframes,))
    out = Information(
        H,
        layout,
        R,
        p,
        velocities,
        arrays.pop("X_W", None),
        _GROUPS[group],
        arrays.pop("gravity", None),
        times,
    )
    if arrays:
        raise DataError("array", "is none that --help lists", field=next(iter(arrays)))
    return out


def _matrix(arrays: dict[str, np.ndarray]) -> Any:
    if "H" in arrays:
        H = arrays.pop("H")
        return reals("H", H, (len(np.atleast_1d(H)),) * 2, matrix=True)
    if "H_data" not in arrays:
        rule = "must be present, dense or as H_data, H_indices, H_indptr; or save a problem: vg.save_problems"
        raise DataError("array", rule, field="H")
    parts = [_needed(arrays, name) for name in ("H_data", "H_indices", "H_indptr")]
    data = reals("H_data", parts[0], ("nnz",), matrix=True)
    indices, starts = (
        integers(n, a, ("m",)) for n, a in zip(("H_indices", "H_indptr"), parts[1:], strict=True)
    )
    n = len(starts) - 1
    try:
        H = scipy.sparse.csr_array((data, indices, starts), shape=(n, n))
        H.check_format(full_check=True)
    except ValueError as error:
        raise DataError("H_indptr", f"must be the CSR form of a square matrix: {error}") from error
    return H


def _needed(arrays: dict[str, np.ndarray], name: str) -> np.ndarray:
    if name not in arrays:
        raise DataError("array", "must be present", field=name)
    return arrays.pop(name)


def _text(arrays: dict[str, np.ndarray], name: str, default: str) -> str:
    value = arrays.pop(name, np.array(default))
    if value.dtype.kind != "U" or value.ndim:
        raise DataError(name, "must be one text", value=value)
    return str(value)
