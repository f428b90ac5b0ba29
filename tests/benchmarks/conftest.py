"""One small problem, its files, and competitors that misbehave on purpose."""

import sys
from pathlib import Path

import pytest

from benchmarks.competitors import Competitor
from benchmarks.problems import Size, cached_problem
from benchmarks.race import Bench, Rules
from vigauge.model.archive import load_problems

# Speaks the protocol of the workers; argument 1 says how it misbehaves, 2 is the problem.
_FAKE = """
import json, sys, time
from pathlib import Path
from dataclasses import replace
from benchmarks.exchange import write_matrix, write_state
from vigauge.model.archive import load_problems
from vigauge.gauge.gauges import FreeGauge
from vigauge.solver.levenberg_marquardt import Options, solve
import numpy as np
manner = sys.argv[1]
problem = load_problems(sys.argv[2])[0]
print("a library says hello")
print(json.dumps({"ready": True}), flush=True)
for line in sys.stdin:
    verb, *words = line.split()
    answer = {"peak_mib": 1.0}
    if verb in ("solve", "covariance"):
        if manner == "slow":
            time.sleep(600)
        if manner == "dies":
            sys.exit("no licence found")
        if manner == "greedy":
            np.ones(2**31)
        answer |= {"seconds": 0.5, "iterations": 5, "cost": 1.0, "converged": True}
    if verb == "state":
        state = solve(problem, FreeGauge(), Options(function_tolerance=1e-9)).state
        if manner == "wrong":
            state = replace(state, v_W=state.v_W + 1e-3)
        write_state(Path(words[0]), state)
    if verb == "matrix":
        write_matrix(Path(words[0]), np.eye(9 * problem.initial.n_keyframes))
    print(json.dumps(answer), flush=True)
"""


@pytest.fixture(scope="session")
def small(tmp_path_factory):
    """(problem, its files) with 10 keyframes and 40 landmarks."""
    files = cached_problem(Size(10, 40), tmp_path_factory.mktemp("problems"))
    return load_problems(files[0])[0], files


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def bench(small, tmp_path, said) -> Bench:
    problem, files = small
    rules = Rules(limit_s=120.0, memory_gib=8.0, budget_s=1.0, rounds=3)
    return Bench(problem, files, tmp_path, rules, said.append)


@pytest.fixture
def fake(tmp_path):
    """A competitor that misbehaves in the given manner."""
    script = Path(tmp_path / "fake.py")
    script.write_text(f"import sys; sys.path.insert(0, '.')\n{_FAKE}", encoding="utf-8")

    def make(manner: str, name: str = "ceres") -> Competitor:
        command = (sys.executable, str(script), manner)
        return Competitor(name, command, False, ("free",), {"free": "-"})

    return make
