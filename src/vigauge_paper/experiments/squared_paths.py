"""Paths of the paper's Fig. 6 with the squares of its weights."""

from __future__ import annotations

from collections.abc import Iterable

import pandas as pd

from vigauge.gauge.gauges import FreeGauge, Gauge, PriorGauge
from vigauge.model.problem import Problem
from vigauge.solver.levenberg_marquardt import Options, solve

from ..ids import FREE
from .experiment import Experiment, Material, Trials

Row = dict[str, object]


def prior_paths(label: str, problems: Iterable[Problem], gauge: Gauge, options: Options) -> list[Row]:
    """Prior error (m, rad) and mean reprojection error (px) of every iteration, as in Fig. 6."""
    return [
        {
            "label": label,
            "trial": trial,
            "iteration": number,
            "mean_reprojection_px": step.mean_reprojection_px,
            "prior_position_m": step.prior_position_m,
            "prior_yaw_rad": step.prior_yaw_rad,
        }
        for trial, problem in enumerate(problems)
        for number, step in enumerate(solve(problem, gauge, options).trace)
    ]


def rows(material: Material, settings: Trials) -> list[Row]:
    """A row an iteration: the free gauge and every weight squared, on the configuration of the sweep."""
    problems = material.trials(material.sweep_configuration, settings.trials)
    figure6 = pd.read_csv(material.published / "fig06_prior_error_paths.csv", dtype={"weight": str})
    out: list[Row] = []
    for label in figure6["weight"].unique():
        gauge: Gauge = FreeGauge() if label == FREE else PriorGauge(float(label) ** 2)
        out += prior_paths(label, problems, gauge, material.solver)
    return out


EXPERIMENT = Experiment("squared_paths", rows, Trials)
