"""Run the experiments on what the landmarks do: to Fig. 5 by their number, to the free gauge by their draw.

No times are taken, so that two runs give the same bytes.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from itertools import product
from pathlib import Path

from vigauge.cli.command import LOG
from vigauge.solver.levenberg_marquardt import Options
from vigauge.synthetic.landmarks import LAYOUTS
from vigauge.synthetic.scenario import make_scene, make_trial
from vigauge.synthetic.settings import SimulationSettings
from vigauge.synthetic.trajectories import TRAJECTORIES
from vigauge_paper.experiments.free_spread import free_spread
from vigauge_paper.experiments.settings import SceneSettings
from vigauge_paper.experiments.squared_weights import squared_weights
from vigauge_paper.run.artefacts import add_section, add_solver, table_files, write_tables
from vigauge_paper.run.stage import Stamped, parser, run, settings_from

Row = dict[str, object]

TABLES = ("scene_counts", "free_spread")


def squared_scenes(
    configuration: str,
    published: Path,
    simulation: SimulationSettings,
    solver: Options,
    scenes: SceneSettings,
) -> list[Row]:
    """Iterations at the squares of the published weights, for other numbers of landmarks."""
    trajectory, points = configuration.split("_")
    rows: list[Row] = []
    for number in scenes.n_landmarks:
        scene = make_scene(trajectory, points, replace(simulation, n_landmarks=number))
        problems = [make_trial(scene, trial) for trial in range(scenes.trials)]
        about: Row = {"scene": f"n_landmarks={number}"}
        rows += [about | row for row in squared_weights(published, problems, solver, powers=(2,))]
        LOG.info("%s: %d landmarks", configuration, number)
    return rows


def spreads(simulation: SimulationSettings, solver: Options, draws: int) -> list[Row]:
    """The free gauge's spread in other draws of landmarks and noise; no draw is that of the results."""
    rows: list[Row] = []
    for points, trajectory in product(LAYOUTS, TRAJECTORIES):
        for draw in range(draws):
            scene = make_scene(trajectory, points, replace(simulation, seed=simulation.seed + 1 + draw))
            rows.append(free_spread(f"{trajectory}_{points}", draw, make_trial(scene, 0), solver))
    LOG.info("%d draws of every configuration", draws)
    return rows


def work(options: argparse.Namespace) -> None:
    scenes = settings_from(SceneSettings, options.settings, "scenes")
    simulation = settings_from(SimulationSettings, options.simulation, "simulation")
    solver = settings_from(Options, options.solver, "solver")
    tables = {
        "scene_counts": squared_scenes(options.configuration, options.published, simulation, solver, scenes),
        "free_spread": spreads(simulation, solver, scenes.draws),
    }
    write_tables(options.output, TABLES, tables)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--configuration", required=True, help="configuration of the prior's sweep")
    arguments.add_argument("--published", type=Path, required=True, help="folder of the published numbers")
    add_section(arguments, "--simulation", "simulation")
    add_solver(arguments)
    add_section(arguments, "--settings", "scenes")
    arguments.add_argument("--output", type=Path, required=True, help="folder that gets the tables")
    run(
        work,
        arguments,
        Stamped(
            {"simulation": "simulation", "solver": "solver", "settings": "scenes"}, files=table_files(TABLES)
        ),
    )


if __name__ == "__main__":
    main()
