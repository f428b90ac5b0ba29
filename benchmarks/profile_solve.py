"""Where the time of one solve goes, stage by stage and function by function; run as a process of its own.

    python -m benchmarks.profile_solve PROBLEM.npz

Compiled kernels count for the function that calls them. The function profile has the profiler's own
cost in it, a microsecond or so a call; the stages are timed without.
"""

from __future__ import annotations

import cProfile
import json
import pstats
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from vigauge.gauge.gauges import FreeGauge
from vigauge.model.archive import load_problems
from vigauge.model.problem import Problem
from vigauge.solver.levenberg_marquardt import Options, solve
from vigauge.solver.normal_equations import linearise
from vigauge.solver.residuals import evaluate

from .competitors import FUNCTION_TOLERANCE, MAXIMUM_ITERATIONS

# Functions with less than this share of the time are left out.
SMALLEST_SHARE = 0.01

# Runs of a stage: as many as take about that long.
STAGE_S, FEWEST_RUNS, MOST_RUNS = 0.5, 3, 500


def profile(path: Path) -> list[dict[str, object]]:
    """Functions by their own time, largest first: name, calls, own milliseconds, share of the solve."""
    problem = load_problems(path)[0]
    options = Options(function_tolerance=FUNCTION_TOLERANCE, maximum_iterations=MAXIMUM_ITERATIONS)
    solve(problem, FreeGauge(), options)  # compiled and warm
    recorder = cProfile.Profile()
    recorder.runcall(solve, problem, FreeGauge(), options)
    stats = pstats.Stats(recorder).stats  # type: ignore[attr-defined]
    total = sum(own for _, _, own, _, _ in stats.values())
    rows = []
    for (file, _, name), (_, calls, own, cumulative, _) in stats.items():
        if own >= SMALLEST_SHARE * total:
            where = name if file == "~" else f"{Path(file).stem}.{name}"
            rows.append(
                {
                    "function": where,
                    "calls": calls,
                    "own_ms": round(1e3 * own, 3),
                    "cumulative_ms": round(1e3 * cumulative, 3),
                    "share": round(own / total, 4),
                }
            )
    return sorted(rows, key=lambda row: -float(str(row["own_ms"])))


def _median_s(work: Callable[[], object]) -> float:
    work()
    seconds: list[float] = []
    while len(seconds) < FEWEST_RUNS or (sum(seconds) < STAGE_S and len(seconds) < MOST_RUNS):
        begin = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - begin)
    return statistics.median(seconds)


def stage_seconds(problem: Problem) -> dict[str, float]:
    """Median seconds of each stage of an iteration, as the solver runs it; names as in :mod:`.limits`."""
    state = problem.initial
    found = evaluate(problem, state)
    equations = linearise(problem, state, R_CW=found.R_CW)
    damping = 1e-4 * equations.diagonal()
    reduced = equations.eliminate(damping)
    layout = reduced.structure.layout
    nothing = np.empty(0, dtype=np.int64)
    solving = _median_s(lambda: reduced.solve(nothing))
    copying = _median_s(reduced.storage.copy)
    factorising = max(_median_s(lambda: layout.factorise(reduced.storage.copy())) - copying, 0.0)
    return {
        "linearise": _median_s(lambda: linearise(problem, state, R_CW=found.R_CW, spent=equations)),
        "eliminate": _median_s(lambda: equations.eliminate(damping)),
        "factorise": factorising,
        # What a solve does besides: both triangular solutions, and the landmarks' steps.
        "substitute": max(solving - factorising - copying, 0.0),
        "evaluate": _median_s(lambda: evaluate(problem, state)),
    }


def main(path: Path) -> None:
    functions = profile(path)
    print(json.dumps({"functions": functions, "stages": stage_seconds(load_problems(path)[0])}))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
