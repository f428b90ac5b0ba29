"""Checks of a simulated scene against what it claims: noise at the truth, path, speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..covariance.consistency import mean_nees_band
from ..model.problem import Problem
from ..solver.residuals import inertial_residual, visual_residual
from .scenario import Scene

_INERTIAL = ("p_x", "p_y", "p_z", "phi_x", "phi_y", "phi_z", "v_x", "v_y", "v_z")


def _row(name: str, squares: np.ndarray) -> dict[str, object]:
    """Mean square of one component over all trials, with its 99 % band under unit variance."""
    count = squares.size
    low, high = mean_nees_band(1, count, 0.99)
    mean = float(squares.mean())
    return {
        "component": name,
        "mean_square": mean,
        "count": count,
        "low": low,
        "high": high,
        "inside": low <= mean <= high,
    }


def chi_square_at_truth(problems: Sequence[Problem], scene: Scene) -> list[dict[str, object]]:
    """Each residual component at the truth: one row with its mean square and 99 % band.

    Landmarks and poses are the true ones, so every whitened component has unit variance.
    """
    visual = np.concatenate([visual_residual(problem, scene.truth) for problem in problems])
    inertial = np.concatenate([inertial_residual(problem, scene.truth) for problem in problems])
    rows = [_row(f"image_{axis}", visual[:, i] ** 2) for i, axis in enumerate("uv")]
    return rows + [_row(f"imu_{name}", inertial[:, i] ** 2) for i, name in enumerate(_INERTIAL)]


def describe(scene: Scene) -> dict[str, object]:
    """Length, mean speed, largest acceleration and rate of the motion, and counts of the images."""
    t = np.linspace(0.0, scene.settings.duration_s, 2001)
    p_W = scene.trajectory.p_W(t)
    length = float(np.linalg.norm(np.diff(p_W, axis=0), axis=1).sum())
    views = np.bincount(scene.landmark)
    return {
        "path_length_m": length,
        "mean_speed_mps": length / scene.settings.duration_s,
        "maximum_acceleration_mps2": float(np.linalg.norm(scene.trajectory.a_W(t), axis=1).max()),
        "maximum_rate_radps": float(np.linalg.norm(scene.trajectory.omega_B(t), axis=1).max()),
        "n_keyframes": len(scene.keyframe_ns),
        "n_landmarks": scene.truth.n_landmarks,
        "n_observations": len(scene.uv),
        "mean_views_per_landmark": float(views.mean()),
    }
