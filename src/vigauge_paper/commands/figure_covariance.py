"""Draw Figure 9 or 10 (covariance matrices) or Figure 1 (ellipses) from an archive of covariances."""

import argparse
from pathlib import Path

from vigauge.errors import ConfigError
from vigauge_paper.figures.ellipses import draw_ellipses
from vigauge_paper.figures.matrices import draw_covariances
from vigauge_paper.run.artefacts import FILE, STEM
from vigauge_paper.run.stage import parser, run


def work(options: argparse.Namespace) -> None:
    shown = (options.covariance, options.output, options.source, options.published_file)
    if options.kind == "ellipses":
        draw_ellipses(*shown, options.beside)
    elif options.beside:
        raise ConfigError("--beside", "must be left out with --kind matrices, which shows one archive")
    else:
        draw_covariances(*shown)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--kind", choices=("ellipses", "matrices"), required=True)
    arguments.add_argument("--covariance", **FILE)
    arguments.add_argument(
        "--beside", type=Path, nargs="*", default=[], help="ellipses: archives of further sequences"
    )
    arguments.add_argument("--source", choices=("simulation", "euroc", "rendered"), required=True)
    arguments.add_argument("--output", **STEM, help="the PNG; the PDF and the numbers go beside it")
    arguments.add_argument(
        "--published-file", type=Path, help="numbers of the paper's figure to show beside ours"
    )
    run(work, arguments)


if __name__ == "__main__":
    main()
