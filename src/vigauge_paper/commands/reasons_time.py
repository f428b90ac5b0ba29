"""Run an explaining experiment whose numbers are seconds."""

import argparse
import time

from vigauge.files import write_rows
from vigauge.solver.levenberg_marquardt import Options
from vigauge.synthetic.settings import SimulationSettings
from vigauge_paper.experiments.experiment import Material
from vigauge_paper.experiments.registry import EXPERIMENTS, TIMED
from vigauge_paper.ids import CONFIGURATIONS
from vigauge_paper.run.artefacts import FILE, add_prior_information, add_section, add_solver
from vigauge_paper.run.stage import Stamped, parser, run, settings_from


def work(options: argparse.Namespace) -> None:
    experiment = EXPERIMENTS[options.experiment]
    material = Material(
        simulation=settings_from(SimulationSettings, options.simulation, "simulation"),
        solver=settings_from(Options, options.solver, "solver"),
        prior_information=options.prior_information,
        sweep_configuration=options.configuration,
        clock=time.perf_counter,
    )
    settings = settings_from(experiment.settings, options.settings, f"reasons.{experiment.name}")
    write_rows(options.output, experiment.rows(material, settings))


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--experiment", choices=TIMED, required=True)
    arguments.add_argument("--configuration", choices=CONFIGURATIONS, required=True)
    add_section(arguments, "--simulation", "simulation")
    add_solver(arguments)
    add_prior_information(arguments)
    add_section(arguments, "--settings", "reasons.EXPERIMENT")
    arguments.add_argument("--output", **FILE, help="output: its table")
    run(
        work,
        arguments,
        Stamped(
            {"simulation": "simulation", "solver": "solver", "prior_information": "prior.information"},
            timings=("output",),
        ),
    )


if __name__ == "__main__":
    main()
