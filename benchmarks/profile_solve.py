"""Where the time of one solve goes, function by function; run as a process of its own.

    python -m benchmarks.profile_solve PROBLEM.npz

Compiled kernels count for the function that calls them.
"""

from __future__ import annotations

import cProfile
import json
import pstats
import sys
from pathlib import Path

from vigauge.archive import load_problems
from vigauge.gauge import FreeGauge
from vigauge.levenberg_marquardt import Options, solve

from .competitors import FUNCTION_TOLERANCE, MAXIMUM_ITERATIONS

# Functions with less than this share of the time are left out.
SMALLEST_SHARE = 0.01


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


if __name__ == "__main__":
    print(json.dumps(profile(Path(sys.argv[1]))))
