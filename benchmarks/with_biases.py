"""Solves and covariances with biases in the state, beside those without: results/with_biases_*.csv.

GTSAM has its CombinedImuFactor, Ceres the residual that ours has. Rows ``known`` are our own solves of the
same flight and images with known biases: what six more parameters a keyframe cost.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from vigauge.gauge.gauges import FreeGauge
from vigauge.model.archive import load_problems
from vigauge.solver.levenberg_marquardt import Options, solve

from . import problems, problems_with_biases
from .competitors import FUNCTION_TOLERANCE, GAUGES, OURS, Competitor
from .problems import Size
from .race import PARTS, Bench, Rules, race_covariances, race_solves
from .results import Row, covariance_rows, solve_rows

# Longer problems show nothing new, and take GTSAM minutes.
LARGEST = 300
PEERS = (OURS, "gtsam", "ceres")
# As of known biases: longer ones are wanted by blocks.
LARGEST_WHOLE = 100


def rows_of(
    size: Size, field: Sequence[Competitor], data: Path, rules: Rules, say: Callable[[str], None]
) -> tuple[list[Row], list[Row]]:
    """Rows of solves and of covariances at a size, with biases estimated, then known."""
    solves: list[Row] = []
    covariances: list[Row] = []
    for biases, source, names in (
        ("estimated", problems_with_biases.cached_problem, PEERS),
        ("known", problems.cached_problem, (OURS,)),
    ):
        files = source(size, data)
        problem = load_problems(files[0])[0]
        running = [c for c in field if c.name in names]
        say(f"{size.name}: biases {biases}")
        with tempfile.TemporaryDirectory() as scratch:
            bench = Bench(problem, files, Path(scratch), rules, say)
            entries = race_solves(bench, running, 1, GAUGES)
            state = solve(problem, FreeGauge(), Options(function_tolerance=FUNCTION_TOLERANCE)).state
            parts = PARTS if size.n_keyframes <= LARGEST_WHOLE else ("blocks",)
            matrices = race_covariances(bench, running, state, 1, {}, parts)
        solves += [{"biases": biases, **row} for row in solve_rows(size.name, problem, entries)]
        covariances += [{"biases": biases, **row} for row in covariance_rows(size.name, problem, matrices)]
    return solves, covariances
