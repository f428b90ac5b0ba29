"""Solves that experiments share."""

from collections.abc import Iterable, Mapping

import numpy as np

from vigauge.errors import ConfigError
from vigauge.gauge.gauges import Gauge
from vigauge.model.evaluation import trajectory_errors
from vigauge.model.problem import Problem
from vigauge.model.state import BIASES, State
from vigauge.solver.levenberg_marquardt import Options, solve
from vigauge_paper.ids import BIAS_ERRORS, ERRORS, HEADLINE, Row


def under_noise(
    problems: Iterable[Problem], noise: Mapping[str, Mapping[str, float]]
) -> dict[str, list[Problem]]:
    """Problems by noise model, the headline model first. No models: noise as in the problems."""
    problems = list(problems)
    if not noise:
        return {HEADLINE: problems}
    if HEADLINE not in noise:
        raise ConfigError("config section 'noise'", "must have a model 'headline'", value=sorted(noise))
    names = [HEADLINE, *(name for name in noise if name != HEADLINE)]
    return {name: [problem.with_noise(**noise[name]) for problem in problems] for name in names}


def bias_errors(state: State, truth: State) -> Row:
    """RMSE of both biases over the keyframes, rad/s and m/s^2; empty where one of the states has none."""
    if not (state.has_biases and truth.has_biases):
        return dict.fromkeys(BIAS_ERRORS, "")
    differences = (getattr(state, name) - getattr(truth, name) for name in BIASES)
    lengths = (float(np.sqrt(np.mean(np.sum(d**2, axis=1)))) for d in differences)
    return dict(zip(BIAS_ERRORS, lengths, strict=True))


def solve_all(
    name: str, problems: Iterable[Problem], truth: State, gauges: Mapping[str, Gauge], options: Options
) -> list[Row]:
    """Count, cost and errors of every problem in every gauge."""
    rows: list[Row] = []
    for trial, problem in enumerate(problems):
        for label, gauge in gauges.items():
            solution = solve(problem, gauge, options)
            errors = trajectory_errors(solution.state, truth)
            rows.append(
                {
                    "experiment": name,
                    "trial": trial,
                    "gauge": label,
                    "initial_radius": options.initial_radius,
                    "function_tolerance": options.function_tolerance,
                    "status": str(solution.status),
                    "converged": solution.converged,
                    "iterations": solution.iterations,
                    "rejected": sum(not row.accepted for row in solution.trace),
                    "cost": solution.cost,
                    **{name: getattr(errors, name) for name in ERRORS},
                }
            )
    return rows
