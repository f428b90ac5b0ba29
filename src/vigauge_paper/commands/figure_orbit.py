"""Compute and draw Figures 2 and 8 on one simulated problem: optimisation paths, and Eq. (12)."""

import argparse

from vigauge.gauge.gauges import three_gauges
from vigauge.model.archive import load_problems
from vigauge.solver.levenberg_marquardt import Options, solve
from vigauge_paper.figures.chart import Chart
from vigauge_paper.figures.orbit import draw_paths, draw_transformation
from vigauge_paper.prior import information
from vigauge_paper.run.artefacts import FILE, STEM, add_prior, add_solver
from vigauge_paper.run.stage import parser, run, settings_from


def work(options: argparse.Namespace) -> None:
    solver = settings_from(Options, options.solver, "solver")
    problem = load_problems(options.problems)[options.trial]
    gauges = three_gauges(information(options.prior_weight, options.prior_reading))
    solutions = {name: solve(problem, gauge, solver, keep_states=True) for name, gauge in gauges.items()}
    chart = Chart.around(problem, solutions["free"].state)
    draw_paths(chart, solutions, options.paths, options.prior_weight)
    draw_transformation(chart, options.transformation)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--problems", **FILE)
    arguments.add_argument("--trial", type=int, required=True, help="which of the problems")
    add_prior(arguments)
    add_solver(arguments)
    arguments.add_argument("--paths", **STEM, help="PNG of Figure 2")
    arguments.add_argument("--transformation", **STEM, help="PNG of Figure 8")
    run(work, arguments)


if __name__ == "__main__":
    main()
