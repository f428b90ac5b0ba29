"""Time iterations of equal number: gauges and the dense solve that fixation makes smaller."""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from vigauge.files import write_rows
from vigauge.gauge.gauges import three_gauges
from vigauge.solver.levenberg_marquardt import Options
from vigauge.synthetic.scenario import make_scene, make_trial
from vigauge.synthetic.settings import SimulationSettings
from vigauge_paper.experiments.iteration_time import TimeSettings, dense_times, iteration_times
from vigauge_paper.ids import CONFIGURATIONS
from vigauge_paper.run.artefacts import add_prior_weight, add_section, add_solver
from vigauge_paper.run.stage import Stamped, parser, run, settings_from

Row = dict[str, object]


def work(options: argparse.Namespace) -> None:
    times = settings_from(TimeSettings, options.settings, "iteration_time")
    simulation = settings_from(SimulationSettings, options.simulation, "simulation")
    solver = settings_from(Options, options.solver, "solver")
    gauges = three_gauges(options.prior_weight)
    rng = np.random.default_rng(simulation.seed)
    trajectory, points = CONFIGURATIONS[options.configuration]
    rows: list[Row] = []
    for count in times.n_keyframes:
        scene = make_scene(trajectory, points, replace(simulation, n_keyframes=count))
        problem = make_trial(scene, 0)
        rows += iteration_times(problem, gauges, solver, times, time.perf_counter)
        rows += dense_times(count, times.repeats, rng, time.perf_counter)
    write_rows(options.output, rows)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument(
        "--configuration",
        choices=CONFIGURATIONS,
        required=True,
        help="simulated configuration, e.g. sine_plane",
    )
    add_section(arguments, "--simulation", "simulation")
    add_solver(arguments)
    add_prior_weight(arguments)
    add_section(arguments, "--settings", "iteration_time")
    arguments.add_argument("--output", type=Path, required=True, help="a row a run")
    run(
        work,
        arguments,
        Stamped(
            {
                "simulation": "simulation",
                "solver": "solver",
                "prior_weight": "prior.weight",
                "settings": "iteration_time",
            },
            timings=("output",),
        ),
    )


if __name__ == "__main__":
    main()
