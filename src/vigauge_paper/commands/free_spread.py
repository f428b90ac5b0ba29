"""Draw other landmarks and noise than those of the results, and see how the free gauge's variance spreads.

No times are taken, so that two runs give the same bytes.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from vigauge.cli.command import LOG
from vigauge.files import write_rows
from vigauge.solver.levenberg_marquardt import Options
from vigauge.synthetic.scenario import make_scene, make_trial
from vigauge.synthetic.settings import SimulationSettings
from vigauge_paper.experiments.free_spread import SpreadSettings, free_spread
from vigauge_paper.ids import CONFIGURATIONS
from vigauge_paper.run.artefacts import add_section, add_solver
from vigauge_paper.run.stage import Stamped, parser, run, settings_from

Row = dict[str, object]


def spreads(simulation: SimulationSettings, solver: Options, draws: int) -> list[Row]:
    """The free gauge's spread in other draws of landmarks and noise; no draw is that of the results."""
    rows: list[Row] = []
    for name, (trajectory, points) in CONFIGURATIONS.items():
        for draw in range(draws):
            scene = make_scene(trajectory, points, replace(simulation, seed=simulation.seed + 1 + draw))
            rows.append(free_spread(name, draw, make_trial(scene, 0), solver))
    LOG.info("%d draws of every configuration", draws)
    return rows


def work(options: argparse.Namespace) -> None:
    settings = settings_from(SpreadSettings, options.settings, "free_spread")
    simulation = settings_from(SimulationSettings, options.simulation, "simulation")
    solver = settings_from(Options, options.solver, "solver")
    write_rows(options.output, spreads(simulation, solver, settings.draws))


def main() -> None:
    arguments = parser(__doc__)
    add_section(arguments, "--simulation", "simulation")
    add_solver(arguments)
    add_section(arguments, "--settings", "free_spread")
    arguments.add_argument("--output", type=Path, required=True, help="output: a row a draw")
    run(
        work,
        arguments,
        Stamped(
            {"simulation": "simulation", "solver": "solver", "settings": "free_spread"}, outputs=("output",)
        ),
    )


if __name__ == "__main__":
    main()
