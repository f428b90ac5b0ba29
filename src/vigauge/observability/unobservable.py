"""Motions that measurements may be blind to: what the null space of H is compared with.

Each is a tangent vector of the motion parameters (9N or 15N), the landmarks going along with it
as the measurements want: rigid motions and scaling of all keyframes or of one part of the
measurement graph, the drift and tilt of a chain of inertial factors, and the pose or
velocity of one keyframe.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from scipy.sparse.csgraph import breadth_first_order, connected_components

from ..geometry import so3
from ..geometry.so3 import Array
from ..model.problem import Problem
from ..model.state import State
from ..sparsity.layout import motion_columns

GYROSCOPE, ACCELEROMETER = "gyroscope bias", "accelerometer bias"


def measurement_graph(problem: Problem) -> tuple[int, NDArray[np.int64]]:
    """Connected parts of the measurement graph: keyframes joined by shared landmarks or inertially."""
    n, k = problem.initial.n_keyframes, problem.initial.n_landmarks
    f = problem.inertial
    rows = np.concatenate([problem.obs_keyframe, f.first])
    columns = np.concatenate([n + problem.obs_landmark, f.second])
    graph = scipy.sparse.coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(n + k, n + k))
    _, label = connected_components(graph, directed=False)
    # Renumbered, as a landmark alone in its part would count as one.
    numbers, label = np.unique(label[:n], return_inverse=True)
    return len(numbers), label.astype(np.int64)


def _times(problem: Problem) -> Array:
    """(N,) seconds of the keyframes along the inertial factors, from the first of each chain."""
    n, f = problem.initial.n_keyframes, problem.inertial
    graph = scipy.sparse.coo_matrix((f.dt, (f.first, f.second)), shape=(n, n)).tocsr()
    t, known = np.zeros(n), np.zeros(n, dtype=bool)
    for root in range(n):
        if known[root]:
            continue
        order, before = breadth_first_order(graph, root, directed=False)
        known[root] = True
        for node in order[1:]:
            origin = before[node]
            step = graph[origin, node] - graph[node, origin]
            t[node], known[node] = t[origin] + step, True
    return t


def _padded(state: State, parts: Sequence[Array]) -> Array:
    """(n,) motion of positions, rotations and velocities (N, 3); biases stay."""
    out = np.zeros(state.n_motion)
    moved = np.concatenate([part.ravel() for part in parts])
    out[: len(moved)] = moved
    return out


def _moves(problem: Problem, state: State, rows: NDArray[np.bool_]) -> dict[str, Array]:
    """Rigid motions and scaling of some keyframes, with the landmarks that they see: (n, c) each."""
    n = state.n_keyframes
    e = np.eye(3)
    centre = state.p_W[rows].mean(axis=0)
    eye = _eyes(problem, state)
    # The first rotation takes total increments, Eq. (9).
    chain = np.broadcast_to(e, (n, 3, 3)).copy()
    chain[0] = so3.left_jacobian_inverse(state.dphi_0)

    def stacked(p: Array, phi: Array, v: Array) -> Array:
        keep = rows[:, None].astype(float)
        return _padded(state, [keep * p, keep * phi, keep * v])

    zero = np.zeros((n, 3))
    turns = [
        stacked(np.cross(axis, state.p_W - centre), chain @ axis, np.cross(axis, state.v_W)) for axis in e
    ]
    return {
        "position": np.stack([stacked(zero + axis, zero, zero) for axis in e], axis=1),
        "yaw": turns[2][:, None],
        "roll and pitch": np.stack(turns[:2], axis=1),
        "scale": stacked(eye - eye[rows].mean(axis=0), zero, state.v_W)[:, None],
    }


def _dead_reckoning(problem: Problem, state: State) -> dict[str, Array]:
    """What a chain of inertial factors alone leaves open: its first velocity, and its tilt."""
    n, t = state.n_keyframes, _times(problem)[:, None]
    zero, e = np.zeros((n, 3)), np.eye(3)
    g_W = np.array([0.0, 0.0, -problem.gravity])
    drift = [_padded(state, [t * axis, zero, zero + axis]) for axis in e]
    chain = np.broadcast_to(e, (n, 3, 3)).copy()
    chain[0] = so3.left_jacobian_inverse(state.dphi_0)
    tilt = [
        _padded(
            state,
            [np.cross(axis, state.p_W - 0.5 * g_W * t**2), chain @ axis, np.cross(axis, state.v_W - g_W * t)],
        )
        for axis in e[:2]
    ]
    return {"velocity": np.stack(drift, axis=1), "roll and pitch": np.stack(tilt, axis=1)}


def _with_bias(state: State, move: Array, wanted_W: Array) -> Array:
    """A move, and the accelerometer biases that measure accelerations (N, 3) in W less than without it."""
    move = move.copy()
    move[12 * state.n_keyframes :] = -np.einsum("nji,nj->ni", state.R_WB, wanted_W).ravel()
    return move


def tilts_with_bias(problem: Problem, state: State) -> Array:
    """(n, 2) tilts of everything about level axes, with the accelerometer's biases that take them back.

    After a tilt a keyframe measures gravity along another axis of the body. The biases are the same for all
    keyframes, and the tilt is unobservable, where the body does not turn.
    """
    tilts = _moves(problem, state, np.ones(state.n_keyframes, dtype=bool))["roll and pitch"]
    g_W = np.array([0.0, 0.0, -problem.gravity])
    wanted = [np.tile(np.cross(axis, g_W), (state.n_keyframes, 1)) for axis in np.eye(3)[:2]]
    return np.stack([_with_bias(state, *pair) for pair in zip(tilts.T, wanted, strict=True)], axis=1)


def _scale_with_bias(problem: Problem, state: State) -> Array:
    """(n,) a scaling of everything, with the biases that take back an acceleration that the body feels as
    constant."""
    f, felt_W = problem.inertial, np.zeros_like(state.v_W)
    # Of the factor that a keyframe begins; at the end of a chain, of the one before.
    for ends in (f.second, f.first):
        felt_W[ends] = (state.v_W[f.second] - state.v_W[f.first]) / f.dt[:, None]
    return _with_bias(state, _moves(problem, state, np.ones(len(felt_W), dtype=bool))["scale"][:, 0], felt_W)


def _biases(state: State) -> list[tuple[str, tuple[int, ...], Array]]:
    """The biases of single keyframes."""
    unit, columns = np.eye(state.n_motion), motion_columns(state.n_keyframes, state.width)
    return [
        (kind, (i,), unit[:, columns[i, first : first + 3]])
        for kind, first in ((GYROSCOPE, 9), (ACCELEROMETER, 12))
        for i in range(state.n_keyframes)
    ]


def unobservable_moves(problem: Problem, state: State) -> list[tuple[str, tuple[int, ...], Array]]:
    """Motions that may leave all measurements as they are, what is most particular first."""
    n = state.n_keyframes
    unit = np.eye(state.n_motion)
    columns = motion_columns(n, state.width)
    everything = np.ones(n, dtype=bool)
    out: list[tuple[str, tuple[int, ...], Array]] = []
    out += [("velocity", (i,), unit[:, columns[i, 6:9]]) for i in range(n)]
    if state.has_biases:
        out += _biases(state)
        tilts, scale = tilts_with_bias(problem, state), _scale_with_bias(problem, state)
        out += [(ACCELEROMETER, (), tilts), ("scale", (), np.column_stack([tilts, scale]))]
    whole = _moves(problem, state, everything)
    out += [(kind, (), whole[kind]) for kind in ("scale", "roll and pitch")]
    if len(problem.inertial.dt):
        out += [(kind, (), moves) for kind, moves in _dead_reckoning(problem, state).items()]
    count, label = measurement_graph(problem)
    for part in range(count):
        # The part with keyframe 0 is what the others move against.
        if part != label[0]:
            rows = label == part
            members = tuple(map(int, np.flatnonzero(rows)))
            out += [(kind, members, moves) for kind, moves in _moves(problem, state, rows).items()]
    out += [("pose", (i,), unit[:, columns[i, :6]]) for i in range(n)]
    out += [("pose and velocity", (i,), unit[:, columns[i, :9]]) for i in range(n)]
    return out


def scaling(problem: Problem, state: State) -> tuple[Array, Array]:
    """Everything scaled about the mean of the camera's centres: motion part (n,), landmarks (K, 3)."""
    everything = np.ones(state.n_keyframes, dtype=bool)
    centre = _eyes(problem, state).mean(axis=0)
    return _moves(problem, state, everything)["scale"][:, 0], state.X_W - centre


def _eyes(problem: Problem, state: State) -> Array:
    """(N, 3) centres of the first camera in W.

    What keeps directions of view is a scaling of these, not of the body's positions.
    """
    p_BC = problem.cameras[0].p_BC if problem.cameras else np.zeros(3)
    return state.p_W + state.R_WB @ p_BC
