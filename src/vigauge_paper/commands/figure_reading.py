"""Draw what a prior's weight multiplies, in the paper's figures and in ours."""

import argparse

from vigauge_paper.figures.reading import draw_reading
from vigauge_paper.run.artefacts import FILE, STEM
from vigauge_paper.run.stage import parser, run


def work(options: argparse.Namespace) -> None:
    draw_reading(options.pulls, options.output)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--pulls", **FILE, help="table of experiment 'reading'")
    arguments.add_argument("--output", **STEM, help="PNG; PDF and CSV go beside it")
    run(work, arguments)


if __name__ == "__main__":
    main()
