"""The damping of a Levenberg-Marquardt step, and the decrease that it promises."""

from __future__ import annotations

from ..so3 import Array
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
def predicted_decrease(gradient: Array, damping: Array, step: Array) -> float:
    """-(g dx + dx H dx / 2), with H dx = -g - D dx on the columns that move."""
    decrease = 0.0
    for i in range(len(step)):
        decrease += step[i] * (damping[i] * step[i] - gradient[i])
    return 0.5 * decrease
