"""Solves with one setting turned: damping, tolerance, prior weight."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from vigauge.gauge.gauges import FixedGauge, Gauge, PriorGauge
from vigauge.gauge.group import orbit_tangent
from vigauge.model.evaluation import trajectory_errors
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.levenberg_marquardt import Options, solve
from vigauge.solver.normal_equations import linearise

Row = dict[str, object]


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
                    "p_rmse_m": errors.p_rmse_m,
                    "phi_rmse_deg": errors.phi_rmse_deg,
                    "v_rmse_mps": errors.v_rmse_mps,
                }
            )
    return rows


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
