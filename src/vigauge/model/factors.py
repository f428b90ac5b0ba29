"""Motion factors: residuals on keyframes beside the images and the inertial sensor.

GNSS positions, a compass, a velocity sensor, a marginalisation prior, the gauge prior of Eq. (11):
each is one object that gives its whitened residual and its Jacobian at a state. The solver, the
covariance and the diagnosis ask nothing else of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..arrays import indices, reals
from ..errors import DataError
from ..geometry.so3 import Array
from .state import State


@dataclass(frozen=True)
class LinearFactor:
    """A motion factor at one state.

    Attributes
    ----------
    columns : (c,) distinct motion columns that the residual depends on, in the package's order (all
        positions, all rotations, all velocities); :func:`vigauge.sparsity.layout.motion_columns` has them
        by keyframe
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
        last = 9 * state.n_keyframes - 1
        columns = indices(name, self.columns, last + 1, field="columns")
        residual = reals(name, self.residual, ("m",), field="residual")
        jacobian = reals(name, self.jacobian, (len(residual), len(columns)), field="jacobian")
        if len(np.unique(columns)) < len(columns) or not len(columns):
            raise DataError(name, f"must be distinct, in 0..{last}", field="columns", value=columns)
        return LinearFactor(columns, residual, jacobian, self.total)


class MotionFactor(Protocol):
    """A residual on the motion of some keyframes.

    ``keyframes``: numbers of the keyframes it joins, which decides how the reduced system is stored.
    """

    @property
    def keyframes(self) -> tuple[int, ...]: ...

    def at(self, state: State, reference: State) -> LinearFactor:
        """Residual and Jacobian at ``state``; ``reference`` is the initial state of the problem."""
