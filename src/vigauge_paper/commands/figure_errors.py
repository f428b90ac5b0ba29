"""Draw errors of the keyframes against their predicted sigmas."""

import argparse

from vigauge_paper.figures.errors import draw_errors
from vigauge_paper.run.artefacts import NAMED, STEM
from vigauge_paper.run.stage import parser, run


def work(options: argparse.Namespace) -> None:
    archives, truths = dict(options.covariances), dict(options.truths)
    draw_errors(archives, truths, options.output, options.source == "rendered")


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--covariances", **NAMED, help="NAME=archive")
    arguments.add_argument("--truths", **NAMED, help="NAME=truth.npz")
    arguments.add_argument("--source", choices=("euroc", "rendered"), required=True)
    arguments.add_argument("--output", **STEM, help="PNG; PDF and CSV go beside it")
    run(work, arguments)


if __name__ == "__main__":
    main()
