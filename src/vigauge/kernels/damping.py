"""The damping of a Levenberg-Marquardt step, and the decrease that it promises."""

from __future__ import annotations

import math

from ..geometry.so3 import Array
from .compiled import part


@part
def clamped(
    diagonal: Array, scale_squared: Array, lowest: float, highest: float, radius: float, out: Array
) -> None:
    """diag(H) / radius into ``out``; with the columns of J scaled, in [lowest, highest] / radius."""
    for i in range(len(diagonal)):
        scaled = min(max(diagonal[i] * scale_squared[i], lowest), highest)
        out[i] = scaled / (scale_squared[i] * radius)


@part
def predicted_decrease(gradient: Array, damping: Array, step: Array) -> tuple[float, float]:
    """-(g dx + dx H dx / 2), with H dx = -g - D dx on the columns that move; and the step's length."""
    decrease, square = 0.0, 0.0
    for i in range(len(step)):
        decrease += step[i] * (damping[i] * step[i] - gradient[i])
        square += step[i] * step[i]
    return 0.5 * decrease, math.sqrt(square)


@part
def largest(values: Array) -> float:
    """The largest absolute value."""
    out = 0.0
    for value in values:
        out = max(out, abs(value))
    return out


@part
def squares(dphi_0: Array, *vectors: Array) -> float:
    """Sum of squares of an increment (3,) and of vectors (., 3)."""
    total = dphi_0[0] ** 2 + dphi_0[1] ** 2 + dphi_0[2] ** 2
    for array in vectors:
        for i in range(len(array)):
            total += array[i, 0] ** 2 + array[i, 1] ** 2 + array[i, 2] ** 2
    return total
