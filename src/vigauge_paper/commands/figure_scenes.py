"""Draw Figure 3: simulated scenes."""

import argparse

from vigauge_paper.figures.scenes import draw_scenes
from vigauge_paper.run.artefacts import FILE, STEM
from vigauge_paper.run.stage import parser, run


def work(options: argparse.Namespace) -> None:
    titles = [name.replace("_", " ") for name in options.names]
    draw_scenes(titles, options.truths, options.paths, options.output)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--names", nargs="+", required=True, help="configurations, in order")
    arguments.add_argument("--truths", **FILE, nargs="+", help="true states, in the same order")
    arguments.add_argument("--paths", **FILE, nargs="+", help="dense trajectories, in the same order")
    arguments.add_argument("--output", **STEM, help="the PNG; the PDF and the numbers go beside it")
    run(work, arguments)


if __name__ == "__main__":
    main()
