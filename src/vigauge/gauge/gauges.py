"""Gauges as objects: what each holds, adds, and the constraint that it stands for.

A gauge C is given by four equations c(theta) = 0, Eq. (7). For the solver it names motion
columns to hold, or a residual to add; for covariances it gives V, the normal of its
constraints. The tangent U of the orbit, Eq. (15), is common to all. A new gauge is a new
object; nothing else changes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ..arrays import integer, number
from ..errors import VigaugeError
from ..geometry import so3
from ..geometry.so3 import Array
from ..kernels import rotation
from ..model.factors import LinearFactor
from ..model.state import State
from .group import Group, YawTranslation, dimension, local_tangent

Index = NDArray[np.int64]

_NOTHING: Index = np.empty(0, dtype=np.int64)
_NOTHING.setflags(write=False)


@runtime_checkable
class Gauge(Protocol):
    """What the solver, the covariance and the figures ask of a gauge."""

    @property
    def name(self) -> str: ...

    def held(self, state: State) -> Index:
        """Motion columns that do not move."""

    def prior(self, state: State, reference: State) -> LinearFactor | None:
        """Residual to add to the cost, or None."""

    def normal(self, state: State) -> Array:
        """(9N + 3K, d) V: derivative of the d constraints, transposed (Appendix A)."""

    def meet(self, state: State, reference: State) -> tuple[State, float]:
        """theta_C of Eq. (12), where the orbit of ``state`` meets the gauge, and the yaw of the move."""


@cache
def _first_pose_columns(n_keyframes: int) -> Index:
    columns = np.array([0, 1, 2, 3 * n_keyframes + 2], dtype=np.int64)
    columns.setflags(write=False)
    return columns


def first_pose_columns(state: State) -> Index:
    """Columns of p_0 and of the z part of dphi_0: what Eq. (10) sets."""
    return _first_pose_columns(state.n_keyframes)


def _unit_columns(state: State, columns: Index) -> Array:
    V = np.zeros((state.n_parameters, len(columns)))
    V[columns, np.arange(len(columns))] = 1.0
    return V


@dataclass(frozen=True)
class FixedGauge:
    """Gauge fixation, Eq. (10): first position and yaw do not move."""

    name: str = field(default="fix", kw_only=True)

    def held(self, state: State) -> Index:
        return first_pose_columns(state)

    def prior(self, state: State, reference: State) -> LinearFactor | None:
        return None

    def normal(self, state: State) -> Array:
        return _unit_columns(state, first_pose_columns(state))

    def meet(self, state: State, reference: State) -> tuple[State, float]:
        return push_to_first_pose(state, reference)


@dataclass(frozen=True)
class FirstPosePrior:
    """The motion factor of Eq. (11): first position and dphi_0's z part, each with variance 1 / weight."""

    weight: float
    keyframes: tuple[int, ...] = field(default=(0,), init=False)

    def __post_init__(self) -> None:
        number("prior", self.weight, field="weight", least=0.0)

    @cached_property
    def _jacobian(self) -> Array:
        return float(np.sqrt(self.weight)) * np.eye(dimension(YawTranslation()))

    def at(self, state: State, reference: State) -> LinearFactor:
        residual = np.empty(len(self._jacobian))
        rotation.first_pose_error(state.p_W, reference.p_W, state.dphi_0, self._jacobian, residual)
        return LinearFactor(first_pose_columns(state), residual, self._jacobian, total=True)


@dataclass(frozen=True)
class PriorGauge:
    """Gauge prior, Eq. (11), with Sigma_0^P = I / weight (Section V-A).

    Raises DataError for a weight that is negative or not finite. Weight 0 is the free gauge to a solver.
    """

    weight: float
    name: str = field(default="prior", kw_only=True)

    def __post_init__(self) -> None:
        number("gauge 'prior'", self.weight, field="weight", least=0.0)

    @cached_property
    def factor(self) -> FirstPosePrior:
        return FirstPosePrior(self.weight)

    def held(self, state: State) -> Index:
        return _NOTHING

    def prior(self, state: State, reference: State) -> LinearFactor | None:
        return self.factor.at(state, reference)

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

    group: Group = field(default=YawTranslation(), kw_only=True)
    name: str = field(default="free", kw_only=True)

    def held(self, state: State) -> Index:
        return _NOTHING

    def prior(self, state: State, reference: State) -> LinearFactor | None:
        return None

    def normal(self, state: State) -> Array:
        return local_tangent(self.group, state)

    def meet(self, state: State, reference: State) -> tuple[State, float]:
        """Any point of the orbit will do: the estimate stays where it is."""
        return state, 0.0


@dataclass(frozen=True)
class KeyframeGauge:
    """Position and heading of keyframe ``index``; for covariances (solving is as in the free gauge).

    The heading is the z part of the left increment in W. At index 0 that is not what Eq. (10)
    holds, the z part of the total increment, unless dphi_0 is zero or about z.
    """

    index: int = 0
    name: str = field(default="keyframe", kw_only=True)

    def __post_init__(self) -> None:
        integer("gauge 'keyframe'", self.index, field="index")

    def held(self, state: State) -> Index:
        return _NOTHING

    def prior(self, state: State, reference: State) -> LinearFactor | None:
        return None

    def normal(self, state: State) -> Array:
        if not 0 <= self.index < state.n_keyframes:
            raise VigaugeError(f"keyframe {self.index} is not among 0..{state.n_keyframes - 1}")
        weights = np.zeros(state.n_keyframes)
        weights[self.index] = 1.0
        return _mean_pose(state, weights)

    def meet(self, state: State, reference: State) -> tuple[State, float]:
        """The estimate stays where it is: a covariance has no use for where the keyframe is held."""
        return state, 0.0


@dataclass(frozen=True)
class CentroidGauge:
    """Mean position and mean yaw of all keyframes; for covariances (solving is as in the free gauge)."""

    name: str = field(default="centroid", kw_only=True)

    def held(self, state: State) -> Index:
        return _NOTHING

    def prior(self, state: State, reference: State) -> LinearFactor | None:
        return None

    def normal(self, state: State) -> Array:
        return _mean_pose(state, np.full(state.n_keyframes, 1.0 / state.n_keyframes))

    def meet(self, state: State, reference: State) -> tuple[State, float]:
        """The estimate stays where it is: a covariance has no use for where the mean is held."""
        return state, 0.0


def _mean_pose(state: State, weights: Array) -> Array:
    """V of a weighted mean of positions and of the z parts of left increments."""
    n = state.n_keyframes
    V = np.zeros((state.n_parameters, dimension(YawTranslation())))
    for axis in range(3):
        V[axis : 3 * n : 3, axis] = weights
    V[3 * n + 2 : 6 * n : 3, 3] = weights
    # dphi_0 turns the first keyframe by J_l(dphi_0) of its change.
    V[3 * n : 3 * n + 3, 3] = so3.left_jacobian(state.dphi_0)[2] * weights[0]
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
