"""Groups of motions that no measurement sees: dimension, tangent and action of each.

Moving a whole estimate (trajectory and landmarks) by an element of the group leaves every
residual as it is; the estimates reached that way are its orbit. Visual-inertial measurements
see gravity and scale and leave yaw and position (4). Stereo images alone leave a rigid motion
(6), images of one camera a similarity (7).

A new group is a new object of this kind; nothing else in the library changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np

from ..arrays import instance, reals
from ..geometry import so3
from ..geometry.so3 import Array
from ..kernels import rotation
from ..model.state import State


@runtime_checkable
class Group(Protocol):
    """What the covariance asks of a group."""

    @property
    def directions(self) -> tuple[str, ...]:
        """Names of the group's parameters, in the order of the tangent's columns."""

    def tangent(self, state: State) -> Array:
        """(9N + 3K, d) derivative of :meth:`act` at the identity, by the package's parameters."""

    def act(self, state: State, parameters: Array) -> State:
        """The state moved by the element with the parameters (d,), finite."""


def dimension(group: Group) -> int:
    """d: 4 for visual-inertial problems."""
    return len(group.directions)


def orbit_tangent(state: State) -> Array:
    """(9N + 3K, 4) U of Eq. (15): basis of the tangent of the orbit; columns (yaw in rad, x, y, z in m).

    It belongs to this package's parameters: left increments in W, the first rotation as
    Eq. (9), order of :mod:`vigauge.model.state`.
    """
    return _tangent(instance("state", state, State).require_valid())


def _tangent(state: State) -> Array:
    U = np.empty((state.n_parameters, dimension(YawTranslation())))
    rotation.orbit_tangent(state.p_W, state.v_W, state.X_W, state.dphi_0, U)
    return U


def local_tangent(group: Group, state: State) -> Array:
    """(9N + 3K, d) basis of the tangent of a group's orbit, about the state's local origin.

    It spans what ``group.tangent`` spans. About an origin that is far away a turn is nearly a shift,
    and products of the two lose all digits.
    """
    origin = state.local_origin
    if origin is not None:
        state = replace(state, p_W=state.p_W - origin, X_W=state.X_W - origin)
    return group.tangent(state)


@dataclass(frozen=True)
class YawTranslation:
    """Turns about gravity, then shifts: the gauge of visual-inertial problems, Eqs. (4)-(5)."""

    directions: ClassVar[tuple[str, ...]] = ("yaw", "x", "y", "z")

    def tangent(self, state: State) -> Array:
        return _tangent(state)

    def act(self, state: State, parameters: Array) -> State:
        parameters = reals("parameters", parameters, (4,))
        return state.transformed(float(parameters[0]), parameters[1:])


@dataclass(frozen=True)
class Euclidean:
    """Turns about any axis, then shifts: the gauge of calibrated stereo images alone."""

    directions: ClassVar[tuple[str, ...]] = ("roll", "pitch", "yaw", "x", "y", "z")

    def tangent(self, state: State) -> Array:
        axes = np.eye(3)
        return _stacked(state, [*(_turn(state, e) for e in axes), *(_shift(state, e) for e in axes)])

    def act(self, state: State, parameters: Array) -> State:
        parameters = reals("parameters", parameters, (6,))
        return _moved(state, so3.exp(parameters[:3]), parameters[3:], 1.0)


@dataclass(frozen=True)
class Similarity:
    """Turns about any axis, scaling about the origin, then shifts: the gauge of one camera's images alone.

    The last parameter is the logarithm of the scale.
    """

    directions: ClassVar[tuple[str, ...]] = (*Euclidean.directions, "scale")

    def tangent(self, state: State) -> Array:
        scaling = state.p_W, np.zeros_like(state.p_W), state.v_W, state.X_W
        return np.column_stack([Euclidean().tangent(state), _stacked(state, [scaling])])

    def act(self, state: State, parameters: Array) -> State:
        parameters = reals("parameters", parameters, (7,))
        return _moved(state, so3.exp(parameters[:3]), parameters[3:6], float(np.exp(parameters[6])))


_Move = tuple[Array, Array, Array, Array]


def _turn(state: State, axis: Array) -> _Move:
    """Derivatives of positions, rotations, velocities, landmarks by a turn about an axis."""
    rotations = np.tile(axis, (state.n_keyframes, 1))
    rotations[0] = so3.left_jacobian_inverse(state.dphi_0) @ axis
    return np.cross(axis, state.p_W), rotations, np.cross(axis, state.v_W), np.cross(axis, state.X_W)


def _shift(state: State, axis: Array) -> _Move:
    still = np.zeros_like(state.p_W)
    return np.tile(axis, (state.n_keyframes, 1)), still, still, np.tile(axis, (state.n_landmarks, 1))


def _stacked(state: State, moves: Sequence[_Move]) -> Array:
    """Biases, in the body frame, do not move."""
    still = np.zeros(state.n_motion - 3 * state.p_W.size)
    return np.stack(
        [np.concatenate([p.ravel(), R.ravel(), v.ravel(), still, X.ravel()]) for p, R, v, X in moves], axis=1
    )


def _moved(state: State, R: Array, t_W: Array, scale: float) -> State:
    return replace(
        state,
        p_W=scale * state.p_W @ R.T + t_W,
        R_WB=R @ state.R_WB,
        v_W=scale * state.v_W @ R.T,
        X_W=scale * state.X_W @ R.T + t_W,
        dphi_0=so3.log(R @ so3.exp(state.dphi_0)),
    )
