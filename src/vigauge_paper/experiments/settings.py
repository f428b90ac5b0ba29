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


@dataclass(frozen=True)
class AccuracySettings:
    """Changes tried on what the errors depend on (config section 'accuracy').

    ``trials`` of each simulated configuration; ``simulation`` changes as text, KEY=VALUE of the sections
    simulation or solver or of ``ACCEL_ERRORS``, several joined by a comma;
    ``believed_density_factors`` inertial noise that the solver believes, times the real one;
    ``euler_rates_hz`` inertial rates integrated by Euler steps;
    ``landmarks`` counts kept on a sequence, seen by one camera; ``accel_bias_mps2`` and ``gyro_bias_radps``
    errors left in a bias on a sequence, along y and z of the body; ``parts`` into which the keyframes of a
    sequence are cut, each a window of its own; ``seed`` of the choice of landmarks.
    """

    trials: int
    simulation: tuple[str, ...]
    believed_density_factors: tuple[float, ...]
    euler_rates_hz: tuple[float, ...]
    landmarks: tuple[int, ...]
    accel_bias_mps2: float
    gyro_bias_radps: float
    parts: int
    seed: int


@dataclass(frozen=True)
class SceneSettings:
    """Other scenes than the configured one (config section 'scenes').

    ``n_landmarks`` of the prior's configuration under the squares of the weights of Fig. 5, over ``trials``;
    ``draws`` of landmarks and noise of every configuration for the spread of the free gauge.
    """

    n_landmarks: tuple[int, ...]
    trials: int
    draws: int
