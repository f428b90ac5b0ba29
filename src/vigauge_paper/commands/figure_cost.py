"""Draw Figure 7 or 11: time, iterations and time per iteration of the three gauges."""

import argparse

from vigauge_paper.figures.cost import draw_cost
from vigauge_paper.run.artefacts import NAMED, STEM, add_published
from vigauge_paper.run.stage import parser, run


def work(options: argparse.Namespace) -> None:
    solutions, timings = dict(options.solutions), dict(options.timings)
    theirs = dict(zip(solutions, options.published_names, strict=True)) if options.published_names else {}
    file = options.published / options.published_file if options.published and theirs else None
    draw_cost(solutions, timings, theirs, file, options.output, options.source == "rendered")


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--solutions", **NAMED, help="NAME=solutions.csv")
    arguments.add_argument("--timings", **NAMED, help="NAME=timing.csv")
    arguments.add_argument("--source", choices=("simulation", "euroc", "rendered"), required=True)
    arguments.add_argument(
        "--published-file", help="file of the paper's numbers in the folder of --published"
    )
    arguments.add_argument("--published-names", nargs="*", default=[], help="the paper's names, in order")
    arguments.add_argument("--output", **STEM, help="the PNG; the PDF and the numbers go beside it")
    add_published(arguments)
    run(work, arguments)


if __name__ == "__main__":
    main()
