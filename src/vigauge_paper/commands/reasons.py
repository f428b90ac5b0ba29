"""Run the experiments that explain the results and take no times: two runs give the same bytes."""

from __future__ import annotations

import argparse
import time

from vigauge.cli.command import LOG
from vigauge.files import write_rows
from vigauge.solver.levenberg_marquardt import Options
from vigauge.synthetic.settings import SimulationSettings
from vigauge_paper.experiments.experiment import Material
from vigauge_paper.experiments.registry import EXPERIMENTS, UNTIMED
from vigauge_paper.ids import CONFIGURATIONS
from vigauge_paper.run.artefacts import (
    FILE,
    NAMED,
    add_prior_information,
    add_section,
    add_solver,
    table_files,
)
from vigauge_paper.run.stage import Stamped, parser, run, settings_from


def work(options: argparse.Namespace) -> None:
    material = Material(
        simulation=settings_from(SimulationSettings, options.simulation, "simulation"),
        solver=settings_from(Options, options.solver, "solver"),
        prior_information=options.prior_information,
        sweep_configuration=options.sweep_configuration,
        clock=time.perf_counter,
        problems=dict(options.problems),
        truths=dict(options.truths),
        traces=dict(options.traces),
        covariances=dict(options.covariances),
        sweep_trace=options.sweep_trace,
        published=options.published,
    )
    for name in UNTIMED:
        experiment = EXPERIMENTS[name]
        settings = settings_from(experiment.settings, options.settings.get(name, {}), f"reasons.{name}")
        rows = experiment.rows(material, settings)
        write_rows(options.output / f"{name}.csv", rows)
        LOG.info("%s: %d rows", name, len(rows))


def main() -> None:
    arguments = parser(__doc__)
    for name, text in (
        ("problems", "NAME=FILE of simulated problems"),
        ("truths", "NAME=FILE of their true states"),
        ("traces", "NAME=FILE of traces of all experiments"),
        ("covariances", "NAME=FILE of covariances of all experiments"),
    ):
        arguments.add_argument(f"--{name}", **NAMED, help=text)
    arguments.add_argument("--sweep-trace", **FILE, help="trace of the prior sweep")
    arguments.add_argument("--sweep-configuration", choices=CONFIGURATIONS, required=True)
    arguments.add_argument("--published", **FILE, help="folder of the published numbers")
    add_section(arguments, "--simulation", "simulation")
    add_prior_information(arguments)
    add_solver(arguments)
    add_section(arguments, "--settings", "reasons")
    arguments.add_argument("--output", **FILE, help="folder that gets the tables")
    run(
        work,
        arguments,
        Stamped(
            {
                "simulation": "simulation",
                "solver": "solver",
                "prior_information": "prior.information",
                "settings": "reasons",
            },
            files=table_files(UNTIMED),
        ),
    )


if __name__ == "__main__":
    main()
