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


def unobservable_moves(problem: Problem, state: State) -> list[tuple[str, tuple[int, ...], Array]]:
    """Motions that may leave all measurements as they are, what is most particular first."""
    n = state.n_keyframes
    unit = np.eye(state.n_motion)
    columns = motion_columns(n, state.width)
    everything = np.ones(n, dtype=bool)
    out: list[tuple[str, tuple[int, ...], Array]] = []
    out += [("velocity", (i,), unit[:, columns[i, 6:9]]) for i in range(n)]
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
