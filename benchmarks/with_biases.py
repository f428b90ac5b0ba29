"""Solves and covariances with biases in the state, beside those without: results/with_biases_*.csv.

    python -m benchmarks.with_biases [--sizes 10,100,300] [--results FOLDER] [--budget-s SECONDS]

GTSAM has its CombinedImuFactor, Ceres the residual that ours has. Rows ``known`` are our own solves of the
same flight and images with known biases: what six more parameters a keyframe cost.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from vigauge.errors import VigaugeError
from vigauge.files import write_rows
from vigauge.gauge.gauges import FreeGauge
from vigauge.model.archive import load_problems
from vigauge.solver.levenberg_marquardt import Options, solve

from . import problems, problems_with_biases
from .competitors import FUNCTION_TOLERANCE, OURS, competitors
from .problems import SIZES, Size
from .race import Bench, Rules, race_covariances, race_solves
from .results import Row, covariance_rows, solve_rows

HERE = Path(__file__).resolve().parent
PEERS = (OURS, "gtsam", "ceres")
# As of known biases: longer ones are wanted by blocks.
LARGEST_WHOLE = 100


def rows_of(size: Size, options: argparse.Namespace, rules: Rules) -> tuple[list[Row], list[Row]]:
    """Rows of solves and of covariances at a size, with biases estimated, then known."""
    solves: list[Row] = []
    covariances: list[Row] = []
    field = [c for c in competitors(options.build) if c.name in PEERS]
    for biases, source, names in (
        ("estimated", problems_with_biases.cached_problem, PEERS),
        ("known", problems.cached_problem, (OURS,)),
    ):
        files = source(size, options.data)
        problem = load_problems(files[0])[0]
        running = [c for c in field if c.name in names]
        print(f"{size.name}: biases {biases}", flush=True)
        with tempfile.TemporaryDirectory() as scratch:
            bench = Bench(problem, files, Path(scratch), rules, lambda text: print(text, flush=True))
            entries = race_solves(bench, running, 1, ("fix", "prior", "free"))
            state = solve(problem, FreeGauge(), Options(function_tolerance=FUNCTION_TOLERANCE)).state
            parts = ("whole", "blocks") if size.n_keyframes <= LARGEST_WHOLE else ("blocks",)
            matrices = race_covariances(bench, running, state, 1, {}, parts)
        solves += [{"biases": biases, **row} for row in solve_rows(size.name, problem, entries)]
        covariances += [{"biases": biases, **row} for row in covariance_rows(size.name, problem, matrices)]
    return solves, covariances


def main(arguments: list[str] | None = None) -> int:
    known = dict(SIZES)
    parser = argparse.ArgumentParser(prog="python -m benchmarks.with_biases", description=__doc__)
    parser.add_argument("--sizes", default="10,100,300", help="numbers of keyframes")
    parser.add_argument("--results", type=Path, default=HERE / "results")
    parser.add_argument("--data", type=Path, default=HERE / "data", help="problems, made once")
    parser.add_argument("--build", type=Path, default=HERE / "build", help="the compiled C++ program")
    parser.add_argument("--budget-s", type=float, default=20.0, help="time for all runs of one solver")
    options = parser.parse_args(arguments)
    solves: list[Row] = []
    covariances: list[Row] = []
    try:
        for n in map(int, options.sizes.split(",")):
            found = rows_of(Size(n, known[n]), options, Rules(budget_s=options.budget_s))
            solves, covariances = solves + found[0], covariances + found[1]
            write_rows(options.results / "with_biases_solve.csv", solves)
            write_rows(options.results / "with_biases_covariance.csv", covariances)
    except VigaugeError as error:
        print(f"benchmarks: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
