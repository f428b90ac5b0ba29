"""Problems and states on disk: plain ``.npz`` archives, no pickles, same content same bytes.

An archive holds a list: entry i has its arrays under the names ``i/field``.
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .camera import Camera
from .errors import DataError
from .files import atomic_path
from .problem import InertialFactors, Problem
from .state import State

PathLike = str | os.PathLike[str]

_STATE = ("p_W", "R_WB", "v_W", "X_W", "dphi_0", "R_WB0_ref")
_FACTORS = ("first", "second", "dt", "dp", "dR", "dv", "covariance")
_CAMERAS = ("intrinsics", "size", "distortion", "R_BC", "p_BC")
_OBSERVATIONS = ("obs_keyframe", "obs_camera", "obs_landmark", "obs_uv")


def save_arrays(path: PathLike, arrays: Mapping[str, Any]) -> None:
    """Write named arrays to ``path`` (.npz), all or nothing."""
    with atomic_path(path) as temporary:
        np.savez(temporary, **arrays)


def load_arrays(path: PathLike) -> dict[str, np.ndarray]:
    """Read all arrays of an ``.npz`` file; DataError where it is missing or broken."""
    if not Path(path).is_file():
        raise DataError(path, "file must exist")
    try:
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (ValueError, OSError, EOFError, zipfile.BadZipFile, KeyError) as error:
        raise DataError(path, f"must be an npz archive without pickles: {error}") from error


def _state_arrays(state: State) -> dict[str, np.ndarray]:
    return {name: getattr(state, name) for name in _STATE}


def _problem_arrays(problem: Problem) -> dict[str, Any]:
    arrays: dict[str, Any] = {f"initial.{k}": v for k, v in _state_arrays(problem.initial).items()}
    arrays |= {f"inertial.{name}": getattr(problem.inertial, name) for name in _FACTORS}
    arrays |= {name: getattr(problem, name) for name in _OBSERVATIONS}
    arrays["sigma_px"] = problem.sigma_px
    arrays["gravity"] = problem.gravity
    cameras = problem.cameras
    arrays["cameras.intrinsics"] = np.array([[c.fx, c.fy, c.cx, c.cy] for c in cameras])
    arrays["cameras.size"] = np.array([[c.width, c.height] for c in cameras], dtype=np.int64)
    arrays["cameras.distortion"] = np.array([c.distortion for c in cameras])
    arrays["cameras.R_BC"] = np.array([c.R_BC for c in cameras])
    arrays["cameras.p_BC"] = np.array([c.p_BC for c in cameras])
    return arrays


def _state_from(get: Mapping[str, np.ndarray], prefix: str = "") -> State:
    return State(**{name: get[prefix + name] for name in _STATE})


def _problem_from(get: Mapping[str, np.ndarray]) -> Problem:
    cameras = tuple(
        Camera(fx, fy, cx, cy, width, height, (k1, k2, p1, p2), np.array(R_BC), np.array(p_BC))
        for (fx, fy, cx, cy), (width, height), (k1, k2, p1, p2), R_BC, p_BC in zip(
            *(get[f"cameras.{name}"].tolist() for name in _CAMERAS), strict=True
        )
    )
    return Problem(
        initial=_state_from(get, "initial."),
        cameras=cameras,
        inertial=InertialFactors(**{name: get[f"inertial.{name}"] for name in _FACTORS}),
        sigma_px=float(get["sigma_px"]),
        gravity=float(get["gravity"]),
        **{name: get[name] for name in _OBSERVATIONS},
    )


def _save_list(path: PathLike, kind: str, entries: Sequence[Mapping[str, Any]]) -> None:
    arrays: dict[str, Any] = {"kind": np.array(kind), "count": np.array(len(entries))}
    for index, entry in enumerate(entries):
        arrays |= {f"{index}/{name}": value for name, value in entry.items()}
    save_arrays(path, arrays)


def _load_list(path: PathLike, kind: str) -> list[dict[str, np.ndarray]]:
    arrays = load_arrays(path)
    found = str(arrays.get("kind", ""))
    if found != kind:
        raise DataError(path, f"must hold {kind}", field="kind", value=found)
    entries: list[dict[str, np.ndarray]] = [{} for _ in range(int(arrays["count"]))]
    for name, value in arrays.items():
        index, slash, field = name.partition("/")
        if slash:
            entries[int(index)][field] = value
    return entries


def save_problems(path: PathLike, problems: Sequence[Problem]) -> None:
    """Write problems to one archive."""
    _save_list(path, "problems", [_problem_arrays(problem) for problem in problems])


def load_problems(path: PathLike) -> list[Problem]:
    """Read what :func:`save_problems` wrote; DataError where a field is missing or wrong."""
    entries = _load_list(path, "problems")
    try:
        return [_problem_from(entry) for entry in entries]
    except KeyError as error:
        raise DataError(path, "field must be present", field=str(error)) from error


def save_states(path: PathLike, states: Sequence[State]) -> None:
    """Write states to one archive."""
    _save_list(path, "states", [_state_arrays(state) for state in states])


def load_states(path: PathLike) -> list[State]:
    """Read what :func:`save_states` wrote; DataError where a field is missing or wrong."""
    entries = _load_list(path, "states")
    try:
        return [_state_from(entry) for entry in entries]
    except KeyError as error:
        raise DataError(path, "field must be present", field=str(error)) from error
