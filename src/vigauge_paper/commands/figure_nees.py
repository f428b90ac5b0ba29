"""Draw the mean NEES of every configuration and gauge, and of what is broken on purpose."""

import argparse

from vigauge_paper.figures.nees import draw_nees
from vigauge_paper.run.artefacts import FILE, STEM
from vigauge_paper.run.stage import parser, run


def work(options: argparse.Namespace) -> None:
    draw_nees(options.table, options.output)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--table", **FILE, help="table of experiment 'nees'")
    arguments.add_argument("--output", **STEM, help="PNG; PDF and CSV go beside it")
    run(work, arguments)


if __name__ == "__main__":
    main()
