"""Result files of made-up experiments, in the formats of the stages, small and without randomness of runs.

The baseline agrees with every claim of the paper; tests alter one thing and look at what follows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from vigauge.archive import save_arrays

CONFIGURATIONS = ("sine_plane", "arc_plane", "rec_plane", "sine_random", "arc_random", "rec_random")
SEQUENCES = ("MH_01_easy", "V1_01_easy")
WEIGHTS = ("0", "7", "100", "500", "1e5", "1e8")
SWEEP_ITERATIONS = (4, 12, 8, 6, 5, 5)
TRIALS = 12
REPEATS = 3

Change = Callable[[pd.DataFrame], pd.DataFrame]


def solutions(name: str, trials: int = TRIALS) -> pd.DataFrame:
    """solutions.csv: free a little better in p and worse in v, one iteration quicker but on sine random."""
    rng = np.random.default_rng(len(name))
    rows = []
    for trial in range(trials):
        base = 1.0 + 0.1 * rng.normal()
        for gauge in ("fix", "free", "prior"):
            free = gauge == "free"
            quicker = 1 if free and name != "sine_random" else 0
            rows.append(
                {
                    "noise": "headline",
                    "gauge": gauge,
                    "trial": trial,
                    "status": "function tolerance",
                    "converged": True,
                    "iterations": 6 - quicker,
                    "cost": 500.0,
                    "p_rmse_m": 0.03 * base * (0.9995 if free else 1.0),
                    "phi_rmse_deg": 0.12 * base,
                    "v_rmse_mps": 0.02 * base * (1.0005 if free else 1.0),
                    "mean_reprojection_px": 1.2,
                }
            )
    return pd.DataFrame(rows)


def timing(name: str, trials: int = TRIALS, repeats: int = REPEATS) -> pd.DataFrame:
    """timing.csv: 1 ms an iteration under fixation, 2 % more in the other gauges."""
    each = {"fix": 1.0e-3, "free": 1.02e-3, "prior": 1.02e-3}
    rows = solutions(name, trials)[["gauge", "trial", "iterations"]]
    rows = rows.merge(pd.DataFrame({"repeat": range(repeats)}), how="cross")
    drift = 1.0 + 0.01 * rows["trial"] + 0.003 * rows["repeat"]
    return rows.assign(noise="headline", seconds=rows["gauge"].map(each) * rows["iterations"] * drift)


def sweep(trials: int = TRIALS) -> pd.DataFrame:
    """sweep.csv: the same errors under all weights, a peak of iterations at weight 7."""
    rows = [
        {
            "weight": weight,
            "trial": trial,
            "status": "function tolerance",
            "converged": True,
            "iterations": iterations,
            "cost": 500.0,
            "p_rmse_m": 0.03 + 1e-6 * number,
            "phi_rmse_deg": 0.12 + 1e-6 * number,
            "v_rmse_mps": 0.02 + 1e-6 * number,
        }
        for number, (weight, iterations) in enumerate(zip(WEIGHTS, SWEEP_ITERATIONS, strict=True))
        for trial in range(trials)
    ]
    return pd.DataFrame(rows)


def sweep_timing(trials: int = TRIALS) -> pd.DataFrame:
    rows = sweep(trials)[["weight", "trial", "iterations"]]
    return rows.assign(repeat=0, seconds=1e-3 * rows["iterations"] * (1.0 + 0.01 * rows["trial"]))


def sweep_trace() -> pd.DataFrame:
    """trace.csv of trial 0: three iterations under every weight, and the free gauge."""
    rows = [
        {
            "weight": weight,
            "trial": 0,
            "iteration": iteration,
            "cost": 1e4 / 10**iteration,
            "radius": 1e4,
            "accepted": True,
            "mean_reprojection_px": (15.0, 1.6, 1.2)[iteration],
            "prior_position_m": (0.0, 0.09, 0.08)[iteration],
            "prior_yaw_rad": (0.0, 0.04, 0.03)[iteration],
        }
        for weight in ("free", *WEIGHTS)
        for iteration in range(3)
    ]
    return pd.DataFrame(rows)


def covariance(n_keyframes: int = 3) -> dict[str, np.ndarray | float | int]:
    """Archive of covariances: a random one, and its fixed form with zero rows for what is held."""
    rng = np.random.default_rng(5)
    n = 9 * n_keyframes
    root = rng.normal(size=(n, n))
    free = 1e-4 * root @ root.T / n
    held = [0, 1, 2, 3 * n_keyframes + 2]
    fixed = free.copy()
    fixed[held] = 0.0
    fixed[:, held] = 0.0
    p_W = np.cumsum(rng.normal(size=(n_keyframes, 3)), axis=0)
    return {
        "free": free,
        "fixed": fixed,
        "transformed": fixed * (1.0 + 1e-5),
        "relative_frobenius_same_point": 1e-12,
        "relative_frobenius_converged": 1e-5,
        "p_W_free": p_W,
        "p_W_transformed": p_W,
        "p_W_fixed": p_W,
        "n_keyframes": n_keyframes,
        "n_landmarks": 5,
        "n_parameters": n + 15,
        "rank_free": n + 11,
        "rank_fix": n + 11,
        "rank_prior": n + 15,
        "gap": 1e10,
    }


def unchanged(table: pd.DataFrame) -> pd.DataFrame:
    return table


@dataclass(frozen=True)
class Results:
    """Where the files of a made-up run of the pipeline are, and functions that alter them before writing."""

    folder: Path
    solutions: Mapping[str, Change] = field(default_factory=dict)
    timing: Mapping[str, Change] = field(default_factory=dict)
    covariance: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    sweep: Change = unchanged

    def write(self) -> dict[str, dict[str, Path]]:
        """Write all; paths by kind and experiment."""
        paths: dict[str, dict[str, Path]] = {"solutions": {}, "timings": {}, "covariances": {}}
        for name in (*CONFIGURATIONS, *SEQUENCES):
            trials, repeats = (1, 5) if name in SEQUENCES else (TRIALS, REPEATS)
            folder = self.folder / name
            folder.mkdir(parents=True)
            paths["solutions"][name] = folder / "solutions.csv"
            change = self.solutions.get(name, unchanged)
            change(solutions(name, trials)).to_csv(paths["solutions"][name], index=False)
            paths["timings"][name] = folder / "timing.csv"
            change = self.timing.get(name, unchanged)
            change(timing(name, trials, repeats)).to_csv(paths["timings"][name], index=False)
            paths["covariances"][name] = folder / "covariance.npz"
            save_arrays(paths["covariances"][name], covariance() | dict(self.covariance.get(name, {})))
        self.sweep(sweep()).to_csv(self.sweep_file, index=False)
        return paths

    @property
    def sweep_file(self) -> Path:
        return self.folder / "sweep.csv"
