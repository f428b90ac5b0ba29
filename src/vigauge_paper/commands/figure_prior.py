"""Draw Figures 4, 5 and 6: accuracy, cost and paths against the prior weight."""

import argparse

from vigauge_paper.figures.prior import draw_accuracy, draw_cost, draw_paths, read_sweep
from vigauge_paper.prior import READINGS
from vigauge_paper.run.artefacts import FILE, STEM, add_published, add_reading
from vigauge_paper.run.stage import parser, run


def work(options: argparse.Namespace) -> None:
    leading = options.prior_reading
    readings = sorted(READINGS, key=lambda reading: reading != leading)
    sweeps, timings = (
        {reading: read_sweep(file, reading) for reading in readings}
        for file in (options.sweep, options.timing)
    )
    trace = read_sweep(options.trace, leading)
    draw_accuracy(sweeps[leading], options.accuracy, options.published)
    draw_cost(sweeps, timings, options.cost, options.published)
    draw_paths(sweeps[leading], trace, options.paths, options.path_weights, options.published)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--sweep", **FILE)
    arguments.add_argument("--timing", **FILE)
    arguments.add_argument("--trace", **FILE)
    arguments.add_argument(
        "--path-weights", nargs="+", required=True, help="weights of Figure 6 besides the free gauge"
    )
    arguments.add_argument("--accuracy", **STEM, help="PNG of Figure 4")
    arguments.add_argument("--cost", **STEM, help="PNG of Figure 5")
    arguments.add_argument("--paths", **STEM, help="PNG of Figure 6")
    add_reading(arguments)
    add_published(arguments)
    run(work, arguments)


if __name__ == "__main__":
    main()
