"""Draw Figures 4, 5 and 6: accuracy, cost and paths against the prior weight."""

from __future__ import annotations

import argparse
from pathlib import Path

from vigauge_paper.figures.prior import draw_accuracy, draw_cost, draw_paths
from vigauge_paper.run.artefacts import add_published, stem_of
from vigauge_paper.run.stage import parser, run


def work(options: argparse.Namespace) -> None:
    draw_accuracy(options.sweep, options.accuracy, options.published)
    draw_cost(options.sweep, options.timing, options.cost, options.published)
    draw_paths(options.sweep, options.trace, options.paths, options.path_weights, options.published)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--sweep", type=Path, required=True)
    arguments.add_argument("--timing", type=Path, required=True)
    arguments.add_argument("--trace", type=Path, required=True)
    arguments.add_argument(
        "--path-weights", nargs="+", required=True, help="weights of Figure 6 besides the free gauge"
    )
    arguments.add_argument("--accuracy", type=stem_of, required=True, help="PNG of Figure 4")
    arguments.add_argument("--cost", type=stem_of, required=True, help="PNG of Figure 5")
    arguments.add_argument("--paths", type=stem_of, required=True, help="PNG of Figure 6")
    add_published(arguments)
    run(work, arguments)


if __name__ == "__main__":
    main()
