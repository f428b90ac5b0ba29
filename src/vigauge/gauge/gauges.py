"""Gauges as objects: what each holds, adds, and the constraint that it stands for.

A gauge C is given by four equations c(theta) = 0, Eq. (7). For the solver it names motion
columns to hold, or a residual to add; for covariances it gives V, the normal of its
constraints. The tangent U of the orbit, Eq. (15), is common to all. A new gauge is a new
object; nothing else changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import VigaugeError
from ..geometry import so3
from ..geometry.so3 import Array
from ..kernels import rotation
from ..model.state import State

Index = NDArray[np.int64]


@dataclass(frozen=True)
class GaugePrior:
    """Whitened prior residual of Eq. (11).

    ``residual`` (4,), the motion ``columns`` (4,) it depends on, and its ``jacobian`` (4, 4).
    """

    columns: Index
    residual: Array
    jacobian: Array


class Gauge(Protocol):
    """What the solver, the covariance and the figures ask of a gauge."""

    @property
    def name(self) -> str: ...

    def held(self, state: State) -> Index:
        """Motion columns that do not move."""

    def prior(self, state: State, reference: State) -> GaugePrior | None:
        """Residual to add to the cost, or None."""

    def normal(self, state: State) -> Array:
        """(9N + 3K, 4) V: derivative of the constraints, transposed (Appendix A)."""

    def meet(self, state: State, reference: State) -> tuple[State, float]:
        """theta_C of Eq. (12), where the orbit of ``state`` meets the gauge, and the yaw of the move."""


def orbit_tangent(state: State) -> Array:
    """(9N + 3K, 4) U of Eq. (15): basis of the tangent of the orbit; columns (yaw in rad, x, y, z in m).

    It belongs to this package's parameters: left increments in W, the first rotation as
    Eq. (9), order of :mod:`vigauge.model.state`. Biases, which a gauge does not move, have zero rows.
    """
    U = np.empty((state.n_parameters, 4))
    rotation.orbit_tangent(state.p_W, state.v_W, state.X_W, state.dphi_0, U)
    return U


def first_pose_columns(state: State) -> Index:
    """Columns of p_0 and of the z part of dphi_0: what Eq. (10) sets."""
    return np.array([0, 1, 2, 3 * state.n_keyframes + 2], dtype=np.int64)


def _unit_columns(state: State, columns: Index) -> Array:
    V = np.zeros((state.n_parameters, 4))
    V[columns, np.arange(4)] = 1.0
    return V


@dataclass(frozen=True)
class FixedGauge:
    """Gauge fixation, Eq. (10): first position and yaw do not move."""

    name: str = "fix"

    def held(self, state: State) -> Index:
        return first_pose_columns(state)

    def prior(self, state: State, reference: State) -> GaugePrior | None:
        return None

    def normal(self, state: State) -> Array:
        return _unit_columns(state, first_pose_columns(state))

    def meet(self, state: State, reference: State) -> tuple[State, float]:
        return push_to_first_pose(state, reference)


@dataclass(frozen=True)
class PriorGauge:
    """Gauge prior, Eq. (11), with Sigma_0^P = I / weight (Section V-A)."""

    weight: float
    name: str = "prior"

    def held(self, state: State) -> Index:
        return np.empty(0, dtype=np.int64)

    def prior(self, state: State, reference: State) -> GaugePrior | None:
        scale = float(np.sqrt(self.weight))
        error = np.empty(4)
        error[:3] = state.p_W[0] - reference.p_W[0]
        error[3] = state.dphi_0[2]
        return GaugePrior(first_pose_columns(state), scale * error, scale * np.eye(4))

    def normal(self, state: State) -> Array:
        return _unit_columns(state, first_pose_columns(state))

    def meet(self, state: State, reference: State) -> tuple[State, float]:
        return push_to_first_pose(state, reference)


@dataclass(frozen=True)
class FreeGauge:
    """Free gauge: nothing held, nothing added.

    Its covariance, the pseudo-inverse, is the one of the gauge whose normal is the orbit's
    own tangent (the inner constraints of geodesy): V = U.
    """

    name: str = "free"

    def held(self, state: State) -> Index:
        return np.empty(0, dtype=np.int64)

    def prior(self, state: State, reference: State) -> GaugePrior | None:
        return None

    def normal(self, state: State) -> Array:
        return orbit_tangent(state)

    def meet(self, state: State, reference: State) -> tuple[State, float]:
        """Any point of the orbit will do: the estimate stays where it is."""
        return state, 0.0


@dataclass(frozen=True)
class KeyframeGauge(FreeGauge):
    """Position and heading of keyframe ``index``; for covariances (solving is as in the free gauge).

    The heading is the z part of the left increment in W. At index 0 that is not what Eq. (10)
    holds, the z part of the total increment, unless dphi_0 is zero or about z.
    """

    index: int = 0
    name: str = "keyframe"

    def normal(self, state: State) -> Array:
        if not 0 <= self.index < state.n_keyframes:
            raise VigaugeError(f"keyframe {self.index} is not among 0..{state.n_keyframes - 1}")
        n, p = state.n_keyframes, 3 * self.index
        V = np.zeros((state.n_parameters, 4))
        V[p : p + 3, :3] = np.eye(3)
        V[3 * n + p + 2, 3] = 1.0
        if self.index == 0:
            # dphi_0 turns the first keyframe by J_l(dphi_0) of its change.
            V[3 * n : 3 * n + 3, 3] = so3.left_jacobian(state.dphi_0)[2]
        return V


@dataclass(frozen=True)
class CentroidGauge(FreeGauge):
    """Mean position and mean yaw of all keyframes; for covariances (solving is as in the free gauge)."""

    name: str = "centroid"

    def normal(self, state: State) -> Array:
        n = state.n_keyframes
        V = np.zeros((state.n_parameters, 4))
        for axis in range(3):
            V[axis : 3 * n : 3, axis] = 1.0 / n
        # The mean is over left increments; dphi_0 turns the first by J_l(dphi_0) of it.
        V[3 * n + 2 : 6 * n : 3, 3] = 1.0 / n
        V[3 * n : 3 * n + 3, 3] = so3.left_jacobian(state.dphi_0)[2] / n
        return V


def three_gauges(prior_weight: float) -> dict[str, Gauge]:
    """The paper's three approaches by the names that results carry."""
    return {"fix": FixedGauge(), "prior": PriorGauge(prior_weight), "free": FreeGauge()}


def yaw_to_first_pose(state: State) -> float:
    """Angle alpha (rad) of Eq. (13): the turn after which dphi_0 has no z part.

    Swing-twist of q = Exp(dphi_0): alpha = -2 atan2(q_z, q_w), exact, from one estimate.

    Raises
    ------
    VigaugeError
        where the first keyframe was turned upside down, so that no yaw is defined.
    """
    q = so3.quaternion(so3.exp(state.dphi_0))
    if np.hypot(q[0], q[3]) < 1e-9:
        raise VigaugeError("yaw of the first keyframe is undefined: it is turned by pi about a level axis")
    return -2.0 * float(np.arctan2(q[3], q[0]))


def push_to_first_pose(state: State, reference: State) -> tuple[State, float]:
    """theta_C of Eq. (12): ``state`` moved along its orbit until Eq. (10) holds, and the yaw used."""
    alpha = yaw_to_first_pose(state)
    t_W = reference.p_W[0] - so3.yaw_rotation(alpha) @ state.p_W[0]
    pushed = state.transformed(alpha, t_W)
    return pushed, alpha


def oblique_projector(U: Array, V: Array) -> Array:
    """(n, n) Q = I - U (V^T U)^-1 V^T of Eq. (14), dense: for small problems and tests."""
    return np.eye(len(U)) - U @ np.linalg.solve(V.T @ U, V.T)
