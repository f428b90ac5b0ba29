"""The cost on an orbit, Eq. (3)."""

from dataclasses import dataclass

import numpy as np

from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.residuals import cost

from ..ids import Row
from .experiment import Experiment, Material


@dataclass(frozen=True)
class Settings:
    """``transformations`` of every configuration, drawn with ``seed``."""

    transformations: int
    seed: int


def cost_on_orbit(
    name: str, problem: Problem, state: State, count: int, rng: np.random.Generator
) -> list[Row]:
    """Cost of ``state`` and after ``count`` random transformations of Eq. (4): any yaw, shifts up to 10 m."""
    before = cost(problem, state)
    rows: list[Row] = []
    for number in range(count):
        yaw, t_W = rng.uniform(-np.pi, np.pi), rng.uniform(-10.0, 10.0, 3)
        after = cost(problem, state.transformed(yaw, t_W))
        rows.append(
            {
                "experiment": name,
                "transformation": number,
                "yaw_rad": yaw,
                "shift_m": float(np.linalg.norm(t_W)),
                "cost": after,
                "relative_change": (after - before) / before,
            }
        )
    return rows


def rows(material: Material, settings: Settings) -> list[Row]:
    """Every simulated configuration at its start, one generator for all."""
    rng = np.random.default_rng(settings.seed)
    out: list[Row] = []
    for name in material.problems:
        (problem,) = material.trials(name, 1)
        out += cost_on_orbit(name, problem, problem.initial, settings.transformations, rng)
    return out


EXPERIMENT = Experiment("orbit", rows, Settings, reads=("problems",))
