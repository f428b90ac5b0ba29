"""Medians, ratios of interleaved runs and their bootstrap intervals, and slopes in log-log."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

RESAMPLES = 2000
CONFIDENCE = 0.95


def paired_ratio(theirs: Sequence[float], ours: Sequence[float]) -> tuple[float, float, float]:
    """Median of theirs over ours, round by round, with a percentile bootstrap interval.

    Who ran once only, because once took long, is compared with every round of the other. Where both
    ran once there is no interval: its ends are nan. Raises ValueError without any round.
    """
    count = min(len(theirs), len(ours))
    if count == 0:
        raise ValueError("no round to compare")
    if count == 1:
        count = max(len(theirs), len(ours))
        theirs, ours = (list(values) * (count if len(values) == 1 else 1) for values in (theirs, ours))
    ratios = np.asarray(theirs[:count]) / np.asarray(ours[:count])
    if count == 1:
        return float(ratios[0]), float("nan"), float("nan")
    rng = np.random.default_rng(0)
    resampled = np.median(ratios[rng.integers(0, count, (RESAMPLES, count))], axis=1)
    low, high = np.quantile(resampled, [0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)])
    return float(np.median(ratios)), float(low), float(high)


def exponent(sizes: Sequence[float], values: Sequence[float]) -> float:
    """Slope of log(value) over log(size), by least squares; nan for fewer than two sizes."""
    if len(set(sizes)) < 2:
        return float("nan")
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])
