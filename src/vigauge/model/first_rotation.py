"""The total increment of the first rotation, Eq. (9), beside the left increments of Eq. (8).

The first rotation is Exp(dphi_0) R_ref, with dphi_0 as its parameter, so that its yaw can be held. All
sums over measurements are by left increments in W, Exp(dphi) R; what is solved and what leaves the library
is by dphi_0. A small change of dphi_0 is the left increment J_l(dphi_0) d(dphi_0).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..geometry.so3 import Array
from ..kernels import rotation
from .state import State


def chain(state: State) -> Array:
    """(3, 3) d(left increment of R_0) / d(dphi_0) = J_l(dphi_0), from Eq. (9)."""
    out = np.empty((3, 3))
    rotation.left_jacobian(state.dphi_0, out)
    return out


def columns(n_keyframes: int) -> NDArray[np.int64]:
    """(3,) columns of dphi_0 in the package's order of motion parameters."""
    return 3 * n_keyframes + np.arange(3)


def to_left(motion: Array, n_keyframes: int, chain_: Array) -> Array:
    """Changes of the motion (9N, ...) by dphi_0 as changes by the first rotation's left increment."""
    out = motion.copy()
    at = columns(n_keyframes)
    out[at] = chain_ @ motion[at]
    return out
