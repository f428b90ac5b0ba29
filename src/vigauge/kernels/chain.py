"""Cholesky factor of a dense motion system whose velocities and biases form a chain.

Images see poses only. Velocities and biases of a keyframe meet those of the next one, its own pose and the
poses beside it. So they are eliminated one keyframe after another, at little cost, and a dense factor is left
for the poses alone.

Stored are the velocities and biases of all keyframes, ``w`` each, then all poses, ``size`` columns in all: a
lower triangle in LAPACK's full form. What lies above the diagonal may be overwritten.
"""

from __future__ import annotations

import math

from ..geometry.so3 import Array
from . import blas, cholesky
from .blas import Sizes
from .compiled import part
from .sizes import POSE

# Columns of the poses that are made at a time (measured).
_PANEL = 12


@part
def is_chain(storage: Array, size: int, w: int) -> bool:
    """Whether no keyframe's velocity and biases meet those of a keyframe after the next, or its pose."""
    n = size // (w + POSE)
    for k in range(n - 2):
        for c in range(w * k, w * k + w):
            speeds = storage[c * size + w * (k + 2) : c * size + w * n]
            poses = storage[c * size + w * n + POSE * (k + 2) : c * size + size]
            total = 0.0
            for i in range(len(speeds)):
                total += abs(speeds[i])
            for i in range(len(poses)):
                total += abs(poses[i])
            if total != 0.0:  # NaN too
                return False
    return True


@part
def _eliminate(storage: Array, size: int, w: int, k: int, scratch: Sizes) -> bool:
    """A keyframe's columns of the factor, in place, and their share off the next keyframe's columns.

    Elimination fills what they share with earlier poses. False where a pivot is not positive.
    """
    n = size // (w + POSE)
    own, tail = w * k * (size + 1), w * k * size + w * n
    n_speeds, n_poses = w * min(k + 2, n) - w * k, POSE * min(k + 2, n)
    for c in range(w):
        column = storage[own + c * size + c : own + c * size + n_speeds]
        of_poses = storage[tail + c * size : tail + c * size + n_poses]
        whole = c // 4 * 4
        for b in range(0, whole, 4):
            A, B = storage[own + b * size + c :], storage[own + (b + 1) * size + c :]
            C, D = storage[own + (b + 2) * size + c :], storage[own + (b + 3) * size + c :]
            f, g, h, q = A[0], B[0], C[0], D[0]
            cholesky.subtract_four(f, A, g, B, h, C, q, D, column)
            A, B = storage[tail + b * size :], storage[tail + (b + 1) * size :]
            C, D = storage[tail + (b + 2) * size :], storage[tail + (b + 3) * size :]
            cholesky.subtract_four(f, A, g, B, h, C, q, D, of_poses)
        for b in range(whole, c):
            before = storage[own + b * size + c : own + b * size + n_speeds]
            cholesky.subtract(before[0], before, column)
            cholesky.subtract(before[0], storage[tail + b * size : tail + b * size + n_poses], of_poses)
        if not column[0] > 0.0:
            return False
        scale = 1.0 / math.sqrt(column[0])
        for i in range(len(column)):
            column[i] *= scale
        for i in range(n_poses):
            of_poses[i] *= scale
    if n_speeds > w:
        following, meets = storage[w * (k + 1) * size :], storage[own + w :]
        to = w * (k + 1)
        blas.multiply(meets, size, False, meets, size, True, w, w, w, -1, 1, following[to:], size, scratch)
        to = w * n
        blas.multiply(
            storage[tail:],
            size,
            False,
            meets,
            size,
            True,
            n_poses,
            w,
            w,
            -1,
            1,
            following[to:],
            size,
            scratch,
        )
    return True


@part
def _factorise_poses(storage: Array, size: int, w: int, scratch: Sizes) -> bool:
    """The columns of the poses, a panel at a time, less what all columns before have of them."""
    n = size // (w + POSE)
    for c in range(0, POSE * n, _PANEL):
        # Velocities of earlier keyframes than this one do not meet the pose at c.
        first, width, rows = max(c // POSE - 1, 0), min(_PANEL, POSE * n - c), POSE * n - c
        before, panel = storage[w * first * size + w * n + c :], storage[(w * n + c) * (size + 1) :]
        k = w * (n - first) + c
        blas.multiply(before, size, False, before, size, True, rows, width, k, -1, 1, panel, size, scratch)
        if cholesky.factorise_panel(panel, width, rows, size, scratch):
            return False
    return True


@part
def factorise(storage: Array, size: int, w: int, scratch: Sizes) -> bool:
    """Overwrite the triangle by its factor; whether it is positive definite. ``scratch`` (6,)."""
    for k in range(size // (w + POSE)):
        if not _eliminate(storage, size, w, k, scratch):
            return False
    return _factorise_poses(storage, size, w, scratch)


@part
def solve(factor: Array, size: int, w: int, x: Array, scratch: Sizes) -> None:
    """Replace a right-hand side by the solution; ``factor`` is from :func:`factorise`."""
    n = size // (w + POSE)
    poses = w * n
    of_poses = x[poses:]
    for c in range(poses):
        end = min(c // w + 2, n)
        x[c] /= factor[c * (size + 1)]
        cholesky.subtract(x[c], factor[c * size + c + 1 : c * size + w * end], x[c + 1 : w * end])
        cholesky.subtract(
            x[c], factor[c * size + poses : c * size + poses + POSE * end], of_poses[: POSE * end]
        )
    cholesky.solve_block(factor[poses * (size + 1) :], POSE * n, size, of_poses, scratch)
    for c in range(poses - 1, -1, -1):
        end = min(c // w + 2, n)
        column, total, following = factor[c * size : (c + 1) * size], x[c], x[c + 1 :]
        speeds, own = column[c + 1 : w * end], column[poses : poses + POSE * end]
        for i in range(len(speeds)):
            total -= following[i] * speeds[i]
        for i in range(len(own)):
            total -= of_poses[i] * own[i]
        x[c] = total / factor[c * (size + 1)]
