"""Choosing keyframes among the frames of a sequence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...errors import DataError
from .settings import KeyframeSettings

# Frames among which keyframes are chosen optimally; a minute and more of a 20 Hz camera.
_MOST_CANDIDATES = 1500


def select_keyframes(t_ns: NDArray[np.int64], settings: KeyframeSettings) -> NDArray[np.int64]:
    """Indices (N,) of the keyframes among frames with the increasing stamps ``t_ns`` (F,).

    With a count, the first and last frame of the window and those between that make the
    gaps as even as the stamps allow; with a spacing, each frame that lies at least that
    long after the keyframe before it.

    Raises DataError where the window holds fewer frames than keyframes are asked for, or fewer than two.
    """
    time = (t_ns - (settings.window_origin_ns or t_ns[0])) * 1e-9
    window = np.flatnonzero((time >= settings.window_start_s) & (time <= settings.window_end_s))
    needed = max(settings.count, 2)
    if len(window) < needed:
        rule = (
            f"the window {settings.window_start_s:g}..{settings.window_end_s:g} s must hold {needed} frames"
        )
        raise DataError("frames", rule, value=len(window))
    if settings.count:
        return window[_even_subset(time[window], settings.count)]
    chosen = _spaced_subset(time[window], settings.spacing_s)
    if len(chosen) < 2:
        raise DataError(
            "frames", "the spacing must leave two keyframes", field="spacing_s", value=settings.spacing_s
        )
    return window[chosen]


def _even_subset(time: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """The ``count`` entries, ends included, with the least sum of squared gaps.

    Dynamic programme over (number chosen, last chosen). Where frames are dense this is
    even spacing; where they are sparse it leaves out the nearest neighbours. Its table grows
    with the square of the frames, so of a long window an even selection of frames competes.
    """
    most = max(_MOST_CANDIDATES, count)
    if len(time) > most:
        candidates = np.linspace(0, len(time) - 1, most).round().astype(np.int64)
        return candidates[_even_subset(time[candidates], count)]
    squared_gap = np.where(time[None, :] > time[:, None], (time[None, :] - time[:, None]) ** 2, np.inf)
    total = squared_gap[0]
    came_from = [np.zeros(len(time), dtype=np.int64)]
    for _ in range(count - 2):
        candidates = total[:, None] + squared_gap
        came_from.append(np.argmin(candidates, axis=0))
        total = np.min(candidates, axis=0)
    chosen = [len(time) - 1]
    for step in reversed(came_from):
        chosen.append(int(step[chosen[-1]]))
    return np.array(chosen[::-1], dtype=np.int64)


def _spaced_subset(time: NDArray[np.float64], spacing_s: float) -> NDArray[np.int64]:
    chosen = [0]
    for k in range(1, len(time)):
        # A nanosecond of slack: stamps of a steady camera are rounded.
        if time[k] - time[chosen[-1]] >= spacing_s - 1e-9 * 1000:
            chosen.append(k)
    return np.array(chosen, dtype=np.int64)
