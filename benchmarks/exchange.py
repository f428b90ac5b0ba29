"""Flat binary files between Python and the C++ program, and states between all of them.

Little-endian 64-bit integers and floats, one after another, in the order written here and read
in ``ceres_solver.cpp``; a magic word first.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vigauge.errors import DataError
from vigauge.files import atomic_path
from vigauge.model.problem import Problem
from vigauge.model.state import State

PROBLEM_MAGIC = b"VIGPROB2"
STATE_MAGIC = b"VIGSTAT1"


def _integers(*arrays: np.ndarray | int) -> bytes:
    return b"".join(np.asarray(a, dtype="<i8").tobytes() for a in arrays)


def _floats(*arrays: np.ndarray | Sequence[float] | float) -> bytes:
    return b"".join(np.asarray(a, dtype="<f8").tobytes() for a in arrays)


def _state_floats(state: State) -> bytes:
    biases = [b for b in (state.gyro_bias, state.accel_bias) if b is not None]
    return _floats(state.p_W, state.R_WB, state.v_W, state.X_W, state.dphi_0, *biases)


def write_problem(path: Path, problem: Problem) -> None:
    """The measurements, whitened factors and start of a problem, all or nothing."""
    f, start = problem.inertial, problem.initial
    by_biases = [b for b in (f.by_gyro_bias, f.by_accel_bias, f.gyro_bias, f.accel_bias) if b is not None]
    parts = [
        PROBLEM_MAGIC,
        _integers(start.n_keyframes, start.n_landmarks, len(problem.cameras), len(problem.obs_uv), len(f.dt)),
        _integers(start.width),
        _floats(problem.sigma_px, problem.gravity),
        _state_floats(start),
        _floats(start.R_WB0_ref),
        *(_floats([c.fx, c.fy, c.cx, c.cy], c.R_BC, c.p_BC) for c in problem.cameras),
        _integers(problem.obs_keyframe, problem.obs_camera, problem.obs_landmark),
        _floats(problem.obs_uv),
        _integers(f.first, f.second),
        _floats(f.dt, f.dp, f.dR, f.dv, f.whitener, *by_biases),
    ]
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        for part in parts:
            stream.write(part)


def write_state(path: Path, state: State) -> None:
    """A state, all or nothing."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(
            STATE_MAGIC + _integers(state.n_keyframes, state.n_landmarks) + _state_floats(state)
        )


def read_state(path: Path, like: State) -> State:
    """A state that any of the solvers wrote; ``like`` has its sizes and its first reference rotation.

    Raises DataError where the file is no state, or one of another size.
    """
    raw = path.read_bytes()
    if raw[:8] != STATE_MAGIC:
        raise DataError(path, "must be a state file", field="magic", value=raw[:8])
    n, k = (int(v) for v in np.frombuffer(raw, "<i8", 2, 8))
    if (n, k) != (like.n_keyframes, like.n_landmarks):
        raise DataError(
            path, f"must have {like.n_keyframes} keyframes, {like.n_landmarks} landmarks", value=(n, k)
        )
    values = np.frombuffer(raw, "<f8", offset=24)
    biases = 3 * n if like.has_biases else 0
    if len(values) != 15 * n + 3 * k + 3 + 2 * biases:
        raise DataError(path, "is cut short", field="length", value=len(values))
    p, R, v, X, dphi_0, gyro, accel = np.split(values, np.cumsum([3 * n, 9 * n, 3 * n, 3 * k, 3, biases]))
    return State(
        p_W=p.reshape(n, 3).copy(),
        R_WB=R.reshape(n, 3, 3).copy(),
        v_W=v.reshape(n, 3).copy(),
        X_W=X.reshape(k, 3).copy(),
        dphi_0=dphi_0.copy(),
        R_WB0_ref=like.R_WB0_ref,
        gyro_bias=gyro.reshape(n, 3).copy() if biases else None,
        accel_bias=accel.reshape(n, 3).copy() if biases else None,
    ).require_valid()


def write_matrix(path: Path, matrix: np.ndarray) -> None:
    """A matrix, or several, row by row, without a header."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(np.asarray(matrix, dtype="<f8").tobytes())


def read_matrix(path: Path, shape: tuple[int, ...]) -> np.ndarray:
    """What :func:`write_matrix` or the C++ program wrote; DataError for a file of another length."""
    values = np.fromfile(path, "<f8")
    if len(values) != np.prod(shape):
        raise DataError(path, f"must hold {' x '.join(map(str, shape))} numbers", value=len(values))
    return values.reshape(shape)
