"""Simulate and solve all configurations with one assumption changed, without taking times."""

import argparse

from vigauge.cli.command import LOG
from vigauge.files import write_rows
from vigauge.gauge.gauges import three_gauges
from vigauge.solver.levenberg_marquardt import Options
from vigauge.synthetic.scenario import make_scene, make_trials
from vigauge.synthetic.settings import SimulationSettings
from vigauge_paper.experiments.changes import changed
from vigauge_paper.experiments.interleaved import Trial, solution_row, solve_once
from vigauge_paper.ids import CONFIGURATIONS, HEADLINE
from vigauge_paper.run.artefacts import FILE, add_prior_information, add_section, add_solver
from vigauge_paper.run.stage import Stamped, parser, run, settings_from


def work(options: argparse.Namespace) -> None:
    settings, solver = changed(
        settings_from(SimulationSettings, options.settings | {"n_trials": options.trials}, "simulation"),
        settings_from(Options, options.solver, "solver"),
        options.parameter,
        options.value,
    )
    gauges = three_gauges(options.prior_information)
    for name, (trajectory, points) in CONFIGURATIONS.items():
        scene = make_scene(trajectory, points, settings)
        trials = [Trial({"noise": HEADLINE, "trial": i}, p) for i, p in enumerate(make_trials(scene))]
        rows = [solution_row(solve, scene.truth) for solve in solve_once(trials, gauges, solver)]
        write_rows(options.output / f"{name}.csv", rows)
        LOG.info("%s = %g: %s", options.parameter, options.value, name)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--parameter", required=True, help="key of config section simulation or solver")
    arguments.add_argument("--value", type=float, required=True)
    arguments.add_argument("--trials", type=int, required=True, help="trials of each configuration")
    add_section(arguments, "--settings", "simulation")
    add_solver(arguments)
    add_prior_information(arguments)
    arguments.add_argument("--output", **FILE, help="folder that gets a CSV a configuration")
    run(
        work,
        arguments,
        Stamped(
            {
                "settings": "simulation",
                "solver": "solver",
                "prior_information": "prior.information",
                "trials": "sensitivity.trials",
            },
            files=lambda options: sorted(options.output.glob("*.csv")),
        ),
    )


if __name__ == "__main__":
    main()
