"""The solution of a reduced camera system, back to the landmarks, in one call."""

from __future__ import annotations

import numpy as np

from ..geometry.so3 import Array
from . import chain, cholesky, first_rotation, schur, symmetric
from .compiled import kernel
from .lanes import Index
from .sizes import POSE


@kernel
def solve(
    storage: Array,
    motion_gradient: Array,
    held: Index,
    stored: Index,
    column: Index,
    stride: int,
    half_bandwidth: int,
    at: int,
    first_chain: Array,
    factor: Array,
    half_gradient: Array,
    information: Array,
    p_W: Array,
    X_W: Array,
    step: Array,
    *batches: Index,
) -> bool:
    """The step (9N + 3K,) in the package's order; ``storage`` is overwritten by its factor.

    False where the system is not positive definite. The ``held`` columns of the package's order do not
    move. The first rotation is stored from ``at`` on, see :mod:`.first_rotation`; the rest as in
    :func:`.schur.back_substitute`.
    """
    size = len(stored)
    symmetric.hold(storage, held, stored, stride, half_bandwidth)
    w, scratch = size // len(p_W) - POSE, np.empty(6, dtype=np.int32)
    chained = stride != half_bandwidth and chain.is_chain(storage, size, w)
    if chained:
        if not chain.factorise(storage, size, w, scratch):
            return False
    elif not cholesky.factorise(storage, size, stride, half_bandwidth):
        return False
    motion = np.empty(size)
    for i in range(size):
        motion[i] = -motion_gradient[i]
    for i in held:
        motion[stored[i]] = 0.0
    if chained:
        chain.solve(storage, size, w, motion, scratch)
    else:
        cholesky.solve(storage, stride, half_bandwidth, motion)
    first_rotation.to_left(motion, stored, at, first_chain, step)
    schur.back_substitute(
        information,
        p_W,
        X_W,
        factor,
        half_gradient,
        column,
        motion,
        step[size:].reshape(-1, 3),
        *batches,
    )
    return True
