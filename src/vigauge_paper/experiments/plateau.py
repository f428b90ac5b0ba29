"""Iterations against the prior weight: what moves the two ends of the peak of Fig. 5."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from vigauge.gauge.gauges import FixedGauge, PriorGauge
from vigauge.gauge.group import orbit_tangent
from vigauge.model.problem import Problem
from vigauge.solver.levenberg_marquardt import Options, solve
from vigauge.solver.normal_equations import linearise

from .evidence import Evidence
from .experiment import Experiment, Material

Row = dict[str, object]


@dataclass(frozen=True)
class Settings:
    """``trials`` of the sweep of ``weights``; ``radius`` (first trust region) and ``function_tolerance`` are
    turned one at a time.
    """

    trials: int
    weights: tuple[str, ...]
    radius: float
    function_tolerance: float


def damping_of_orbit(problem: Problem, radius: float) -> float:
    """Weight of a prior that pulls as hard as the first damping does: median over the orbit's directions.

    A shift or turn along the orbit costs the damping u^T D u / radius and the prior w |V^T u|^2,
    with D the diagonal of H, u a column of U, Eq. (15), and V as in Eq. (10).
    """
    state = problem.initial
    U = orbit_tangent(state)
    felt = U.T @ FixedGauge().normal(state)
    damping = np.einsum("ij,i,ij->j", U, linearise(problem, state).diagonal(), U) / radius
    return float(np.median(damping / np.sum(felt**2, axis=1)))


def plateau(
    problems: Iterable[Problem], weights: Iterable[str], variants: Mapping[str, Options]
) -> list[Row]:
    """Iterations against prior weight for several options: where peak and plateau of Fig. 5 go."""
    rows: list[Row] = []
    kept, names = list(problems), list(weights)
    for variant, options in variants.items():
        for trial, problem in enumerate(kept):
            balance = damping_of_orbit(problem, options.initial_radius)
            for weight in names:
                solution = solve(problem, PriorGauge(float(weight)), options)
                rows.append(
                    {
                        "variant": variant,
                        "initial_radius": options.initial_radius,
                        "function_tolerance": options.function_tolerance,
                        "trial": trial,
                        "weight": weight,
                        "damping_weight": balance,
                        "converged": solution.converged,
                        "iterations": solution.iterations,
                    }
                )
    return rows


def rows(material: Material, settings: Settings) -> list[Row]:
    """A row a run: as configured, with the other radius, with the other tolerance."""
    variants = {
        "as configured": material.solver,
        "radius": replace(material.solver, initial_radius=settings.radius),
        "tolerance": replace(material.solver, function_tolerance=settings.function_tolerance),
    }
    return plateau(material.trials(material.sweep_configuration, settings.trials), settings.weights, variants)


def plateau_start(means: pd.Series) -> str:
    """Smallest weight from which on the mean count stays within half an iteration of the last one."""
    start = means.index[-1]
    for weight in reversed(means.index):
        if abs(means[weight] - means.iloc[-1]) > 0.5:
            break
        start = weight
    return str(start)


def sentence(e: Evidence) -> str:
    """What moves the two ends of the peak."""
    parts = []
    for _, rows in e.reason("plateau").groupby("variant", sort=False):
        means = rows.groupby("weight", sort=False)["iterations"].mean()
        parts.append(
            f"radius {rows['initial_radius'].iloc[0]:g}, tolerance {rows['function_tolerance'].iloc[0]:g}, "
            f"damping along the orbit {rows['damping_weight'].median():.2g}: "
            f"peak {means.max():.1f} at {means.idxmax()}, settled from {plateau_start(means)}"
        )
    return (
        "the peak begins where the function tolerance notices the prior and ends where the prior outweighs "
        f"the damping along the orbit: {'; '.join(parts)}{e.left_out('plateau')}"
    )


EXPERIMENT = Experiment("plateau", rows, Settings)
