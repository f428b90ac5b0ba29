"""Draw Figure 9 or 10 (covariance matrices) or Figure 1 (ellipses) from an archive of covariances."""

from __future__ import annotations

import argparse
from pathlib import Path

from vigauge_paper.figures.ellipses import draw_ellipses
from vigauge_paper.figures.matrices import draw_covariances
from vigauge_paper.run.artefacts import stem_of
from vigauge_paper.run.stage import parser, run

_KINDS = {"matrices": draw_covariances, "ellipses": draw_ellipses}


def work(options: argparse.Namespace) -> None:
    _KINDS[options.kind](options.covariance, options.output, options.source, options.published_file)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--kind", choices=sorted(_KINDS), required=True)
    arguments.add_argument("--covariance", type=Path, required=True)
    arguments.add_argument("--source", choices=("simulation", "euroc", "rendered"), required=True)
    arguments.add_argument(
        "--output", type=stem_of, required=True, help="the PNG; the PDF and the numbers go beside it"
    )
    arguments.add_argument(
        "--published-file", type=Path, help="numbers of the paper's figure to show beside ours"
    )
    run(work, arguments)


if __name__ == "__main__":
    main()
