"""Settings of the experiments that explain the results (config section 'reasons')."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """How much is run, and what is turned.

    ``trials`` of each simulated configuration; ``radii`` first trust-region radii of runs with
    less damping; ``tight_tolerance`` function tolerance of runs to the very minimum;
    ``plateau_weights``, ``plateau_trials``, ``plateau_radius`` and ``plateau_tolerance`` of the
    experiment on Fig. 5, which turns one of the last two at a time; ``large_weights`` tried for
    stability (Section V-A); ``transformations`` of Eq. (4) drawn with ``seed``.
    """

    trials: int
    radii: tuple[float, ...]
    tight_tolerance: float
    plateau_weights: tuple[str, ...]
    plateau_trials: int
    plateau_radius: float
    plateau_tolerance: float
    large_weights: tuple[str, ...]
    transformations: int
    seed: int
