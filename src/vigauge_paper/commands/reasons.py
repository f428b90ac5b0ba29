"""Run an experiment that explains the results and takes no times: two runs give the same bytes."""

import argparse
import time

from vigauge.cli.command import LOG
from vigauge.files import write_rows
from vigauge.solver.levenberg_marquardt import Options
from vigauge.synthetic.settings import SimulationSettings
from vigauge_paper.experiments.experiment import Material
from vigauge_paper.experiments.registry import EXPERIMENTS, UNTIMED
from vigauge_paper.ids import CONFIGURATIONS
from vigauge_paper.run.artefacts import FILE, NAMED, add_prior_information, add_section, add_solver
from vigauge_paper.run.stage import Stamped, parser, run, settings_from

# Files that an experiment may read, by flag.
_FILES = {
    "problems": "NAME=FILE of simulated problems",
    "truths": "NAME=FILE of their true states",
    "covariances": "NAME=FILE of covariances of all experiments",
    "sweep_trace": "NAME=FILE of the trace of the prior sweep",
}


def work(options: argparse.Namespace) -> None:
    experiment = EXPERIMENTS[options.experiment]
    material = Material(
        simulation=settings_from(SimulationSettings, options.simulation, "simulation"),
        solver=settings_from(Options, options.solver, "solver"),
        prior_information=options.prior_information,
        sweep_configuration=options.sweep_configuration,
        clock=time.perf_counter,
        published=options.published,
        **{name: dict(getattr(options, name)) for name in _FILES},
    )
    settings = settings_from(experiment.settings, options.settings, f"reasons.{experiment.name}")
    rows = experiment.rows(material, settings)
    write_rows(options.output, rows)
    LOG.info("%d rows", len(rows))


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--experiment", choices=UNTIMED, required=True)
    for name, text in _FILES.items():
        arguments.add_argument(f"--{name}", **(NAMED | {"required": False, "default": []}), help=text)
    arguments.add_argument("--sweep-configuration", choices=CONFIGURATIONS, required=True)
    arguments.add_argument("--published", **FILE, help="folder of the published numbers")
    add_section(arguments, "--simulation", "simulation")
    add_prior_information(arguments)
    add_solver(arguments)
    add_section(arguments, "--settings", "reasons.EXPERIMENT")
    arguments.add_argument("--output", **FILE, help="output: its table")
    run(
        work,
        arguments,
        Stamped(
            {"simulation": "simulation", "solver": "solver", "prior_information": "prior.information"},
            outputs=("output",),
        ),
    )


if __name__ == "__main__":
    main()
