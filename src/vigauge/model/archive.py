"""Problems and states on disk: plain ``.npz`` archives, no pickles, same content same bytes.

An archive holds a list: entry i has its arrays under the names ``i/field``. What an archive
says of itself is checked before memory is reserved for it.
"""

from __future__ import annotations

import io
import math
import os
import struct
import sys
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..arrays import integers, reals
from ..errors import DataError
from ..files import atomic_path
from ..geometry.camera import LENSES, RADIAL_TANGENTIAL, Camera
from .factors import BiasPrior
from .loss import LOSSES, Loss
from .problem import InertialFactors, Problem
from .state import State

PathLike = str | os.PathLike[str]
T = TypeVar("T")

# Ours are stored as they are and the published matrices compress to a tenth; a bomb does 1000 to one.
_EXPANSION = 100
_ALWAYS_ALLOWED_BYTES = 1_000_000
_KINDS = "biufcU"
# What zipfile and NumPy raise on files that are not what they seem.
_BROKEN = (
    ValueError, TypeError, OSError, EOFError, KeyError, IndexError, RuntimeError, MemoryError, OverflowError,
    SyntaxError, tokenize.TokenError, struct.error, zipfile.BadZipFile, zlib.error,
)  # fmt: skip

_STATE = ("p_W", "R_WB", "v_W", "X_W", "dphi_0", "R_WB0_ref")
_FACTORS = ("first", "second", "dt", "dp", "dR", "dv", "covariance")
# There where biases are estimated.
_BIASES = ("gyro_bias", "accel_bias")
_BY_BIASES = ("by_gyro_bias", "by_accel_bias", *_BIASES)
# A lens with five coefficients makes the distortion five wide for all.
_CAMERAS: dict[str, tuple[int, ...]] = {
    "intrinsics": (4,),
    "size": (2,),
    "distortion": (4,),
    "R_BC": (3, 3),
    "p_BC": (3,),
}
_OBSERVATIONS = ("obs_keyframe", "obs_camera", "obs_landmark", "obs_uv")
_INTEGERS = {
    "first", "second", "obs_keyframe", "obs_camera", "obs_landmark", "cameras.size", "bias_priors.keyframe",
}  # fmt: skip


def save_arrays(path: PathLike, arrays: Mapping[str, Any]) -> None:
    """Write named arrays to ``path`` (.npz), all or nothing."""
    with atomic_path(path) as temporary:
        np.savez(temporary, **arrays)


def load_arrays(path: PathLike) -> dict[str, np.ndarray]:
    """Read all arrays of an ``.npz`` file; DataError where it is missing or broken."""
    if not Path(path).is_file():
        raise DataError(path, "file must exist")
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            total = sum(member.file_size for member in members)
            if total > max(_ALWAYS_ALLOWED_BYTES, _EXPANSION * Path(path).stat().st_size):
                raise ValueError(f"its members would take {total} bytes")
            return {member.filename.removesuffix(".npy"): _array(archive, member) for member in members}
    except _BROKEN as error:
        raise DataError(path, f"must be an npz archive without pickles: {error}") from error


@lru_cache
def _header(header: bytes) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, whether columns come first, and type. To parse one takes longer than to read most arrays."""
    stream = io.BytesIO(header)
    version = np.lib.format.read_magic(stream)
    if version == (1, 0):
        return np.lib.format.read_array_header_1_0(stream)
    if version == (2, 0):
        return np.lib.format.read_array_header_2_0(stream)
    raise ValueError(f"format version {version} is unknown")


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> np.ndarray:
    """A member; ValueError where it is no ``.npy`` file of plain numbers or text, whole and no longer."""
    with archive.open(member) as stream:
        start = stream.read(np.lib.format.MAGIC_LEN)
        length = stream.read(4 if start.endswith(b"\x02\x00") else 2)
        shape, columns_first, dtype = _header(start + length + stream.read(int.from_bytes(length, "little")))
        if dtype.kind not in _KINDS:
            raise ValueError(f"{member.filename} must hold numbers or text, not {dtype}")
        size = math.prod(shape) * dtype.itemsize
        if min(shape, default=0) < 0 or size != member.file_size - stream.tell():
            raise ValueError(f"{member.filename} has another size than its header says")
        content = bytearray(stream.read(size))
        letters = np.frombuffer(content, f"{dtype.byteorder}u4") if dtype.kind == "U" else np.empty(0)
        if letters.max(initial=0) > sys.maxunicode:
            raise ValueError(f"{member.filename} must hold text in Unicode")
        return np.ndarray(shape, dtype, content, order="F" if columns_first else "C")


def _state_arrays(state: State) -> dict[str, np.ndarray]:
    return {name: getattr(state, name) for name in (*_STATE, *(_BIASES if state.has_biases else ()))}


def _camera_arrays(cameras: tuple[Camera, ...]) -> dict[str, Any]:
    """Field by field; ``lens`` only where some camera has another than the radial-tangential one."""
    width = max([4, *(len(c.distortion) for c in cameras)])
    arrays: dict[str, Any] = {
        "intrinsics": [[c.fx, c.fy, c.cx, c.cy] for c in cameras],
        "size": [[c.width, c.height] for c in cameras],
        "distortion": [(*c.distortion, 0.0)[:width] for c in cameras],
        "R_BC": [c.R_BC for c in cameras],
        "p_BC": [c.p_BC for c in cameras],
    }
    for name, values in arrays.items():
        dtype = np.int64 if f"cameras.{name}" in _INTEGERS else np.float64
        shape = (width,) if name == "distortion" else _CAMERAS[name]
        arrays[name] = np.array(values, dtype=dtype).reshape(-1, *shape)
    if any(c.lens != RADIAL_TANGENTIAL for c in cameras):
        arrays["lens"] = np.array([c.lens for c in cameras])
    return {f"cameras.{name}": array for name, array in arrays.items()}


def _problem_arrays(problem: Problem) -> dict[str, Any]:
    arrays: dict[str, Any] = {f"initial.{k}": v for k, v in _state_arrays(problem.initial).items()}
    factors = (*_FACTORS, *(_BY_BIASES if problem.estimates_biases else ()))
    arrays |= {f"inertial.{name}": getattr(problem.inertial, name) for name in factors}
    arrays |= {name: getattr(problem, name) for name in _OBSERVATIONS}
    arrays["sigma_px"] = problem.sigma_px
    if problem.obs_noise is not None:
        arrays["obs_noise"] = problem.obs_noise
    arrays["gravity"] = problem.gravity
    priors = [factor for factor in problem.factors if isinstance(factor, BiasPrior)]
    if priors:
        arrays["bias_priors.keyframe"] = np.array([p.keyframe for p in priors], dtype=np.int64)
        numbers = [[*p.gyro, *p.accel, p.gyro_sigma, p.accel_sigma] for p in priors]
        arrays["bias_priors.numbers"] = np.array(numbers)
    if problem.loss is not None:
        arrays["loss"] = problem.loss.kind
        arrays["loss.delta"] = problem.loss.delta
    return arrays | _camera_arrays(problem.cameras)


class _Entry:
    """The fields of one entry, each checked for its type when it is taken."""

    def __init__(self, fields: Mapping[str, np.ndarray]) -> None:
        self.fields = fields

    def take(self, name: str, *, number: bool = False) -> np.ndarray:
        if name not in self.fields:
            raise DataError("entry", "field must be present", field=name)
        array = self.fields[name]
        integer = name.removeprefix("inertial.") in _INTEGERS
        if array.dtype != (np.int64 if integer else np.float64):
            rule = "must be 64-bit integers" if integer else "must be 64-bit floats"
            raise DataError("entry", rule, field=name, value=array.dtype)
        if (array.ndim == 0) != number:
            rule = "must be a single number" if number else "must be an array"
            raise DataError("entry", rule, field=name, value=array.shape)
        return array

    def take_all(self, prefix: str, names: Sequence[str], optional: Sequence[str]) -> dict[str, np.ndarray]:
        """The named fields, and of the optional ones those that are there."""
        there = [name for name in optional if prefix + name in self.fields]
        return {name: self.take(prefix + name) for name in (*names, *there)}


def _state_from(entry: _Entry, prefix: str = "") -> State:
    return State(**entry.take_all(prefix, _STATE, _BIASES)).require_valid()


def _status_from(entry: _Entry) -> str:
    status = entry.fields.get("status")
    if status is None or status.dtype.kind != "U" or status.ndim:
        raise DataError("entry", "must be the status of a run", field="status")
    return str(status)


def _cameras_from(entry: _Entry) -> tuple[Camera, ...]:
    arrays = {name: entry.take(f"cameras.{name}") for name in _CAMERAS}
    count = len(arrays["intrinsics"])
    lenses = entry.fields.get("cameras.lens", np.full(count, RADIAL_TANGENTIAL))
    if lenses.shape != (count,) or not np.all(np.isin(lenses, list(LENSES))):
        rule = f"must be one of {', '.join(LENSES)} for each camera"
        raise DataError("entry", rule, field="cameras.lens", value=lenses.tolist())
    for name, shape in _CAMERAS.items():
        if name == "distortion" and arrays[name].shape == (count, 5):
            continue
        if arrays[name].shape != (count, *shape):
            raise DataError(
                "entry", f"shape must be {(count, *shape)}", field=f"cameras.{name}", value=arrays[name].shape
            )
    # A fifth coefficient of zero is that of another camera's lens.
    distortion = [tuple(d if np.any(d[4:]) else d[:4]) for d in arrays.pop("distortion").tolist()]
    return tuple(
        Camera(*map(float, k), int(size[0]), int(size[1]), d, R, p, lens)  # type: ignore[arg-type, call-arg]
        for k, size, R, p, d, lens in zip(*arrays.values(), distortion, lenses.tolist(), strict=True)
    )


def _loss_from(entry: _Entry) -> Loss | None:
    """Archives without the field are of problems without a loss."""
    if "loss" not in entry.fields and "loss.delta" not in entry.fields:
        return None
    name = str(entry.fields.get("loss"))
    if name not in LOSSES:
        raise DataError("entry", f"must be one of {', '.join(LOSSES)}", field="loss", value=name)
    return LOSSES[name](float(entry.take("loss.delta", number=True)))


def _bias_priors_from(entry: _Entry) -> tuple[BiasPrior, ...]:
    """Archives without the fields are of problems without such priors."""
    if "bias_priors.keyframe" not in entry.fields and "bias_priors.numbers" not in entry.fields:
        return ()
    keyframe = integers("entry", entry.take("bias_priors.keyframe"), ("m",), field="bias_priors.keyframe")
    shape = (len(keyframe), 8)
    numbers = reals("entry", entry.take("bias_priors.numbers"), shape, field="bias_priors.numbers")
    rows = zip(keyframe.tolist(), numbers, strict=True)
    return tuple(BiasPrior(k, row[:3], row[3:6], float(row[6]), float(row[7])) for k, row in rows)


def _problem_from(entry: _Entry) -> Problem:
    initial = _state_from(entry, "initial.")
    return Problem(
        initial=initial,
        cameras=_cameras_from(entry),
        inertial=InertialFactors(**entry.take_all("inertial.", _FACTORS, _BY_BIASES)),
        sigma_px=float(entry.take("sigma_px", number=True)),
        gravity=float(entry.take("gravity", number=True)),
        factors=_bias_priors_from(entry),
        biases="estimated" if initial.has_biases else "known",
        loss=_loss_from(entry),
        obs_noise=entry.take("obs_noise") if "obs_noise" in entry.fields else None,
        **{name: entry.take(name) for name in _OBSERVATIONS},
    )


def _save_list(path: PathLike, kind: str, entries: Sequence[Mapping[str, Any]]) -> None:
    arrays: dict[str, Any] = {"kind": np.array(kind), "count": np.array(len(entries))}
    for index, entry in enumerate(entries):
        arrays |= {f"{index}/{name}": value for name, value in entry.items()}
    save_arrays(path, arrays)


def _load_list(path: PathLike, kind: str, build: Callable[[_Entry], T]) -> list[T]:
    arrays = load_arrays(path)
    found = str(arrays.get("kind", ""))
    if found != kind:
        raise DataError(path, f"must hold {kind}", field="kind", value=found)
    count = arrays.get("count")
    if count is None or count.shape != () or count.dtype.kind != "i" or not 0 <= count <= len(arrays):
        raise DataError(path, "must be a number of entries that are there", field="count", value=count)
    entries: list[dict[str, np.ndarray]] = [{} for _ in range(int(count))]
    places = {str(index): entry for index, entry in enumerate(entries)}
    for name, value in arrays.items():
        index, slash, field = name.partition("/")
        if slash and index not in places:
            raise DataError(path, f"must belong to one of {len(entries)} entries", field=name)
        if slash:
            places[index][field] = value
    out = []
    for number, entry in enumerate(entries):
        try:
            out.append(build(_Entry(entry)))
        except DataError as error:
            rule = f"entry {number}: {error.rule}"
            raise DataError(path, rule, row=error.row, field=error.field, value=error.value) from error
    return out


def save_problems(path: PathLike, problems: Sequence[Problem]) -> None:
    """Write problems to one archive.

    DataError for one with motion factors other than :class:`.factors.BiasPrior`: those are code, not data.
    """
    for problem in problems:
        codes = [factor for factor in problem.factors if not isinstance(factor, BiasPrior)]
        if codes:
            rule = "cannot hold motion factors other than BiasPrior"
            raise DataError(path, rule, field="factors", value=len(codes))
    _save_list(path, "problems", [_problem_arrays(problem) for problem in problems])


def load_problems(path: PathLike) -> list[Problem]:
    """Read what :func:`save_problems` wrote; DataError where a field is missing or wrong."""
    return _load_list(path, "problems", _problem_from)


def save_states(path: PathLike, states: Sequence[State], statuses: Sequence[str] = ()) -> None:
    """Write states to one archive, estimates with the status of the run that each ended."""
    labels: list[dict[str, Any]] = [{"status": np.array(status)} for status in statuses] or [
        {} for _ in states
    ]
    _save_list(path, "states", [_state_arrays(s) | label for s, label in zip(states, labels, strict=True)])


def load_states(path: PathLike) -> list[State]:
    """Read what :func:`save_states` wrote; DataError where a field is missing or wrong."""
    return _load_list(path, "states", _state_from)


def load_statuses(path: PathLike) -> list[str]:
    """Status of the run that each state of an archive ended; DataError where there is none."""
    return _load_list(path, "states", _status_from)
