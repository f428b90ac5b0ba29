"""Motion factors: residuals on keyframes beside the images and the inertial sensor.

GNSS positions, a compass, a velocity sensor, a marginalisation prior, the gauge prior of Eq. (11):
each is one object that gives its whitened residual and its Jacobian at a state. The solver, the
covariance and the diagnosis ask nothing else of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ..arrays import indices, integer, number, reals
from ..errors import DataError
from ..geometry.so3 import Array
from ..kernels.sizes import KEYFRAME
from ..sparsity.layout import motion_columns
from .state import State


class LinearFactor(NamedTuple):
    """A motion factor at one state.

    Attributes
    ----------
    columns : (c,) distinct motion columns that the residual depends on, in the package's order (all
        positions, all rotations, all velocities, all biases); they are
        :func:`vigauge.sparsity.layout.motion_columns` by keyframe
    residual : (m,) whitened residual, zero mean and unit covariance
    jacobian : (m, c) its derivative by the columns
    total : False: a rotation's columns are its left increment in W, as for every keyframe. True: those of
        the first rotation are its total increment dphi_0 of Eq. (9)
    """

    columns: NDArray[np.int64]
    residual: Array
    jacobian: Array
    total: bool = False

    def require_valid(self, name: str, state: State) -> LinearFactor:
        """This factor, if its shapes fit and its numbers are finite; else DataError."""
        last = state.n_motion - 1
        columns = indices(name, self.columns, last + 1, field="columns")
        residual = reals(name, self.residual, ("m",), field="residual")
        jacobian = reals(name, self.jacobian, (len(residual), len(columns)), field="jacobian")
        if len(np.unique(columns)) < len(columns) or not len(columns):
            raise DataError(name, f"must be distinct, in 0..{last}", field="columns", value=columns)
        return LinearFactor(columns, residual, jacobian, self.total)


@runtime_checkable
class MotionFactor(Protocol):
    """A residual on the motion of some keyframes.

    ``keyframes``: numbers of the keyframes it joins, which decides how the reduced system is stored.
    """

    @property
    def keyframes(self) -> tuple[int, ...]: ...

    def at(self, state: State, reference: State) -> LinearFactor:
        """Residual and Jacobian at ``state``; ``reference`` is the initial state of the problem."""


@dataclass(frozen=True, eq=False)
class BiasPrior:
    """What is known beforehand of a keyframe's biases: a motion factor.

    ``gyro`` (3,) rad/s and ``accel`` (3,) m/s^2 with their standard deviations ``gyro_sigma`` and
    ``accel_sigma``, each for all three axes. They are those of a
    calibration, or of the window before.

    Raises DataError for other shapes, a sigma that is not positive, and, from :meth:`at`, where the state has
    no biases.
    """

    keyframe: int
    gyro: Array
    accel: Array
    gyro_sigma: float
    accel_sigma: float

    def __post_init__(self) -> None:
        name = "bias prior"
        object.__setattr__(self, "keyframe", integer(name, self.keyframe, field="keyframe"))
        for field in ("gyro", "accel"):
            object.__setattr__(self, field, reals(name, getattr(self, field), (3,), field=field))
            sigma = number(name, getattr(self, f"{field}_sigma"), field=f"{field}_sigma", above=0.0)
            object.__setattr__(self, f"{field}_sigma", sigma)

    @property
    def keyframes(self) -> tuple[int, ...]:
        return (self.keyframe,)

    def at(self, state: State, reference: State) -> LinearFactor:
        if state.gyro_bias is None or state.accel_bias is None:
            rule = "must have biases for a prior on them: Problem(..., biases='estimated')"
            raise DataError("bias prior", rule, field="state")
        i = self.keyframe
        columns = motion_columns(state.n_keyframes, state.width)[i, KEYFRAME:]
        weight = 1.0 / np.repeat([self.gyro_sigma, self.accel_sigma], 3)
        error = np.concatenate([state.gyro_bias[i] - self.gyro, state.accel_bias[i] - self.accel])
        return LinearFactor(columns, weight * error, np.diag(weight))
