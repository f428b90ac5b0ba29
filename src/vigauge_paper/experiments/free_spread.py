"""How the position variance of the free gauge is spread over the keyframes, and what it goes with."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vigauge.covariance.covariance import motion_covariance
from vigauge.gauge.gauges import FreeGauge
from vigauge.geometry.so3 import Array
from vigauge.model.problem import Problem
from vigauge.solver.levenberg_marquardt import Options, solve
from vigauge.synthetic.scenario import make_scene, make_trial

from ..ids import CONFIGURATIONS
from .evidence import Evidence
from .experiment import Experiment, Material, Row

# Largest over smallest position variance of the free gauge: twice the paper's largest (Figs. 1, 9, 10), 2.3.
LARGEST_SPREAD = 4.6


@dataclass(frozen=True)
class Settings:
    """``draws`` of landmarks and noise of every configuration."""

    draws: int


def position_variances(covariance: Array, keyframes: int) -> Array:
    """(N,) variance of each keyframe's position, m^2: trace of its block of a (9N, 9N) covariance."""
    return np.diagonal(covariance)[: 3 * keyframes].reshape(keyframes, 3).sum(axis=1)


def free_spread(name: str, draw: int, problem: Problem, options: Options) -> Row:
    """Largest over smallest position variance, and how it goes with the place of the points.

    ``correlation`` is that of the variance with the squared distance to the centre of all positions and
    landmarks, over the keyframes: the free gauge holds that centre best.
    """
    solution = solve(problem, FreeGauge(), options)
    state = solution.state
    variance = position_variances(motion_covariance(problem, state, FreeGauge()), state.n_keyframes)
    centre = np.vstack([state.p_W, state.X_W]).mean(axis=0)
    distance = np.sum((state.p_W - centre) ** 2, axis=1)
    return {
        "experiment": name,
        "draw": draw,
        "converged": solution.converged,
        "ratio": float(variance.max() / variance.min()),
        "correlation": float(np.corrcoef(distance, variance)[0, 1]),
    }


def rows(material: Material, settings: Settings) -> list[Row]:
    """The spread in other draws of landmarks and noise; no draw is that of the results."""
    out: list[Row] = []
    for name, (trajectory, points) in CONFIGURATIONS.items():
        for draw in range(settings.draws):
            seed = material.simulation.seed + 1 + draw
            scene = make_scene(trajectory, points, replace(material.simulation, seed=seed))
            out.append(free_spread(name, draw, make_trial(scene, 0), material.solver))
    return out


def position_variance(e: Evidence, name: str, gauge: str) -> Array:
    """(N,) variance of each keyframe's position, m^2: trace of its block."""
    arrays = e.covariance(name)
    return position_variances(arrays[gauge], int(arrays["n_keyframes"]))


def free_ratios(e: Evidence) -> dict[str, float]:
    """Largest over smallest position variance of the free gauge in every experiment."""
    ratios = {}
    for name in e.covariances:
        variance = position_variance(e, name, "free")
        ratios[name] = float(variance.max() / variance.min()) if variance.min() > 0.0 else float("inf")
    return ratios


def sentence(e: Evidence) -> str:
    """Which landmarks are drawn decides how far from the centre of all points the keyframes lie.

    It explains a ratio that is too large if in most of the other draws of that experiment it is not.
    """
    table = e.reason("free_spread")
    ratios = free_ratios(e)
    outside = [name for name, ratio in ratios.items() if ratio >= LARGEST_SPREAD]
    worst = max(outside or e.configurations, key=lambda name: ratios[name])
    drawn = table.loc[table["experiment"] == worst, "ratio"]
    if drawn.empty:
        return f"not explained: {worst} is not simulated, and has no other draw"
    inside = int((drawn < LARGEST_SPREAD).sum())
    text = (
        f"which landmarks are drawn: in {len(drawn)} other draws of {worst} the ratio is "
        f"{drawn.min():.2g} to {drawn.max():.2g}, below {LARGEST_SPREAD:g} in {inside}. The variance goes "
        "with the squared distance to the centre of all positions and landmarks (over keyframes, correlation "
        f"{table['correlation'].min():.2f} to {table['correlation'].max():.2f} in all configurations)"
        f"{e.left_out('free_spread')}"
    )
    return text if 2 * inside > len(drawn) else f"not explained: {text}"


EXPERIMENT = Experiment("free_spread", rows, Settings)
