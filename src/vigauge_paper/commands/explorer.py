"""Take an estimate's inverse and null space out of a result, for the gauge explorer of index.html."""

import argparse

from vigauge.files import write_json
from vigauge.gauge.gauges import three_gauges
from vigauge.model.archive import load_arrays, load_problems, load_states
from vigauge_paper.experiments.solves import under_noise
from vigauge_paper.ids import FREE, HEADLINE
from vigauge_paper.page.explorer import explorer_data
from vigauge_paper.run.artefacts import FILE
from vigauge_paper.run.stage import json_argument, parser, run


def work(options: argparse.Namespace) -> None:
    withheld = str(load_arrays(options.covariance)["withheld"])
    if withheld:
        write_json(options.output, {"name": options.name, "withheld": withheld})
        return
    # As solve writes them: the first problem, and its estimates under the headline noise.
    problem = under_noise(load_problems(options.problems)[:1], options.noise)[HEADLINE][0]
    estimate = load_states(options.states)[[*three_gauges(1.0)].index(FREE)]
    truth = load_states(options.truth)[0]
    write_json(options.output, explorer_data(options.name, problem, estimate, truth))


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--name", required=True, help="of the simulated configuration or sequence")
    for name, text in (
        ("problems", "archive; its first problem is used"),
        ("truth", "its true state"),
        ("states", "estimates as solve writes them"),
        ("covariance", "archive of covariances: says whether they are withheld, and why"),
    ):
        arguments.add_argument(f"--{name}", **FILE, help=text)
    arguments.add_argument("--noise", type=json_argument, default={}, help="noise models by name")
    arguments.add_argument("--output", **FILE, help="output: JSON")
    run(work, arguments)


if __name__ == "__main__":
    main()
