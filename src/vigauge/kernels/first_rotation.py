"""From left increments to the total increment of the first rotation, Eq. (9), on stored systems."""

from __future__ import annotations

from ..geometry.so3 import Array
from .compiled import part
from .lanes import Index


@part
def vector_to_total(vector: Array, at: int, chain: Array) -> None:
    """v <- chain^T v at the three entries from ``at`` on, in place."""
    x, y, z = vector[at], vector[at + 1], vector[at + 2]
    for a in range(3):
        vector[at + a] = chain[0, a] * x + chain[1, a] * y + chain[2, a] * z


@part
def system_to_total(
    storage: Array,
    gradient: Array,
    at: int,
    width: int,
    stride: int,
    half_bandwidth: int,
    chain: Array,
    stored: Index,
    damping: Array,
) -> None:
    """T^T S T + diag(damping) of a stored lower triangle and T^T g, in place; ``damping`` may be empty.

    T is the identity with ``chain`` at ``at``.. , and damping in the order of ``stored``, or longer.
    Entry (r, c) is ``storage[c * stride + r]``. A keyframe has ``width`` columns. Blocks of keyframes that
    the band does not reach are zero.
    """
    vector_to_total(gradient, at, chain)
    own, size = at - at % width, len(gradient)
    reach = (half_bandwidth + 1) // width * width
    for c in range(max(own + width - reach, 0), at):
        start = c * stride + at
        x, y, z = storage[start], storage[start + 1], storage[start + 2]
        for a in range(3):
            storage[start + a] = chain[0, a] * x + chain[1, a] * y + chain[2, a] * z
    for r in range(at + 3, min(own + reach, size)):
        first, second, third = at * stride + r, (at + 1) * stride + r, (at + 2) * stride + r
        x, y, z = storage[first], storage[second], storage[third]
        storage[first] = chain[0, 0] * x + chain[1, 0] * y + chain[2, 0] * z
        storage[second] = chain[0, 1] * x + chain[1, 1] * y + chain[2, 1] * z
        storage[third] = chain[0, 2] * x + chain[1, 2] * y + chain[2, 2] * z
    start = at * (stride + 1)
    s00, s10, s20 = storage[start], storage[start + 1], storage[start + 2]
    s11, s21, s22 = storage[start + stride + 1], storage[start + stride + 2], storage[start + 2 * stride + 2]
    for b in range(3):
        x, y, z = chain[0, b], chain[1, b], chain[2, b]
        u, v, w = s00 * x + s10 * y + s20 * z, s10 * x + s11 * y + s21 * z, s20 * x + s21 * y + s22 * z
        for a in range(b, 3):
            storage[start + b * stride + a] = chain[0, a] * u + chain[1, a] * v + chain[2, a] * w
    for i in range(min(len(stored), len(damping))):
        storage[stored[i] * (stride + 1)] += damping[i]


@part
def total_equations(
    storage: Array,
    motion_gradient: Array,
    landmark: Array,
    landmark_gradient: Array,
    stored: Index,
    row: int,
    at: int,
    stride: int,
    chain: Array,
    diagonal: Array,
    gradient: Array,
) -> None:
    """Diagonal of H and g, (n,) each, in the package's order and by total increments.

    The first rotation begins at ``row``, stored at ``at``. H is a motion block stored as in
    :func:`system_to_total` and blocks (K, 3, 3) of landmarks.
    """
    n = len(stored)
    for i in range(n):
        diagonal[i] = storage[stored[i] * (stride + 1)]
        gradient[i] = motion_gradient[stored[i]]
    for j in range(len(landmark)):
        for a in range(3):
            diagonal[n + 3 * j + a] = landmark[j, a, a]
            gradient[n + 3 * j + a] = landmark_gradient[j, a]
    start = at * (stride + 1)
    vector_to_total(gradient, row, chain)
    s00, s10, s20 = storage[start], storage[start + 1], storage[start + 2]
    s11, s21, s22 = storage[start + stride + 1], storage[start + stride + 2], storage[start + 2 * stride + 2]
    for b in range(3):
        x, y, z = chain[0, b], chain[1, b], chain[2, b]
        u, v, w = s00 * x + s10 * y + s20 * z, s10 * x + s11 * y + s21 * z, s20 * x + s21 * y + s22 * z
        diagonal[row + b] = x * u + y * v + z * w


@part
def to_left(motion: Array, stored: Index, at: int, chain: Array, out: Array) -> None:
    """A motion step in stored order: into ``out`` in the package's order, then to left increments."""
    for i in range(len(stored)):
        out[i] = motion[stored[i]]
    x, y, z = motion[at], motion[at + 1], motion[at + 2]
    for a in range(3):
        motion[at + a] = chain[a, 0] * x + chain[a, 1] * y + chain[a, 2] * z
