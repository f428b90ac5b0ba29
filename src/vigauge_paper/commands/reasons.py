"""Run the experiments that explain the results: damping, tolerance, weights, exchange, orbit, yaw.

No times are taken, so that two runs give the same bytes.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from vigauge.cli.command import LOG
from vigauge.gauge.gauges import FixedGauge, FreeGauge, Gauge, PriorGauge, three_gauges
from vigauge.model.archive import load_arrays, load_problems, load_states
from vigauge.model.problem import Problem
from vigauge.solver.levenberg_marquardt import Options
from vigauge_paper.experiments.exchange import exchange, exchange_published
from vigauge_paper.experiments.first_step import from_published, from_traces
from vigauge_paper.experiments.invariance import cost_on_orbit
from vigauge_paper.experiments.settings import Settings
from vigauge_paper.experiments.solves import plateau, prior_paths, solve_all
from vigauge_paper.experiments.squared_weights import squared_weights
from vigauge_paper.experiments.yaw_drift import yaw_drift
from vigauge_paper.run.artefacts import (
    add_prior_weight,
    add_section,
    add_solver,
    named_file,
    table_files,
    write_tables,
)
from vigauge_paper.run.stage import Stamped, parser, run, settings_from

Row = dict[str, object]


def solved(options: argparse.Namespace, settings: Settings, solver: Options) -> dict[str, list[Row]]:
    """Tables of the experiments that solve problems."""
    rng = np.random.default_rng(settings.seed)
    gauges = three_gauges(options.prior_weight)
    large: dict[str, Gauge] = {weight: PriorGauge(float(weight)) for weight in settings.large_weights}
    truths = dict(options.truths)
    turned = {
        "damping": [replace(solver, initial_radius=radius) for radius in settings.radii],
        "tolerance": [solver, replace(solver, function_tolerance=settings.tight_tolerance)],
    }
    tables: dict[str, list[Row]] = {name: [] for name in ("orbit", "yaw", "damping", "tolerance", "weights")}
    for name, file in options.problems:
        problems = load_problems(file)[: settings.trials]
        truth = load_states(truths[name])[0]
        tables["orbit"] += cost_on_orbit(
            name, problems[0], problems[0].initial, settings.transformations, rng
        )
        for trial, problem in enumerate(problems):
            tables["yaw"] += yaw_drift(name, trial, problem, solver)
        for table, changes in turned.items():
            for changed in changes:
                tables[table] += solve_all(name, problems, truth, gauges, changed)
        tables["weights"] += solve_all(name, problems, truth, {"fix": FixedGauge(), **large}, solver)
        LOG.info("%s: %d trials", name, len(problems))
    variants = {
        "as configured": solver,
        "radius": replace(solver, initial_radius=settings.plateau_radius),
        "tolerance": replace(solver, function_tolerance=settings.plateau_tolerance),
    }
    problems = load_problems(dict(options.problems)[options.sweep_configuration])[: settings.plateau_trials]
    tables["plateau"] = plateau(problems, settings.plateau_weights, variants)
    tables["squared"] = squared_weights(options.published, problems, solver)
    tables["squared_paths"] = squared_paths(options.published, problems, solver)
    return tables


# Tables of this stage; other experiments write beside them.
TABLES = (
    "orbit",
    "yaw",
    "damping",
    "tolerance",
    "weights",
    "plateau",
    "squared",
    "squared_paths",
    "exchange",
    "first_step",
)


def squared_paths(published: Path, problems: list[Problem], solver: Options) -> list[Row]:
    """Paths of the paper's Fig. 6 with the squares of its weights."""
    figure6 = pd.read_csv(published / "fig06_prior_error_paths.csv", dtype={"weight": str})
    rows: list[Row] = []
    for label in figure6["weight"].unique():
        gauge: Gauge = FreeGauge() if label == "free" else PriorGauge(float(label) ** 2)
        rows += prior_paths(label, problems, gauge, solver)
    return rows


def read_off(options: argparse.Namespace) -> dict[str, list[Row]]:
    """Tables from finished results and the paper's figures."""
    pairs = []
    for name, file in options.covariances:
        arrays = load_arrays(file)
        if not str(arrays["withheld"]):
            pairs.append(exchange(name, arrays["transformed"], arrays["fixed"]))
    for figure in ("fig09", "fig10"):
        pairs.append(
            exchange_published(f"published {figure}", load_arrays(options.published / f"{figure}.npz"))
        )
    sweep = pd.read_csv(options.sweep_trace, dtype={"weight": str})
    weights = {w: float(w) for w in dict.fromkeys(sweep["weight"]) if w != "free" and float(w) > 0.0}
    steps = from_traces("sweep", sweep, weights, "weight")
    for name, file in options.traces:
        trace = pd.read_csv(file).query("noise == 'headline'")
        steps += from_traces(name, trace, {"prior": options.prior_weight}, "gauge")
    figure6 = pd.read_csv(options.published / "fig06_prior_error_paths.csv", dtype={"weight": str})
    steps += from_published("published fig06", figure6)
    return {"exchange": pairs, "first_step": steps}


def work(options: argparse.Namespace) -> None:
    settings = settings_from(Settings, options.settings, "reasons")
    solver = settings_from(Options, options.solver, "solver")
    tables = solved(options, settings, solver) | read_off(options)
    write_tables(options.output, TABLES, tables)


def main() -> None:
    arguments = parser(__doc__)
    for name, text in (
        ("problems", "NAME=FILE of simulated problems"),
        ("truths", "NAME=FILE of their true states"),
        ("traces", "NAME=FILE of traces of all experiments"),
        ("covariances", "NAME=FILE of covariances of all experiments"),
    ):
        arguments.add_argument(f"--{name}", type=named_file, nargs="+", required=True, help=text)
    arguments.add_argument("--sweep-trace", type=Path, required=True, help="trace of the prior sweep")
    arguments.add_argument("--sweep-configuration", required=True, help="configuration of that sweep")
    arguments.add_argument("--published", type=Path, required=True, help="folder of the published numbers")
    add_prior_weight(arguments)
    add_solver(arguments)
    add_section(arguments, "--settings", "reasons")
    arguments.add_argument("--output", type=Path, required=True, help="folder that gets the tables")
    run(
        work,
        arguments,
        Stamped(
            {"solver": "solver", "prior_weight": "prior.weight", "settings": "reasons"},
            files=table_files(TABLES),
        ),
    )


if __name__ == "__main__":
    main()
