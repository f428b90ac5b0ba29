"""The harness: who is late, greedy, broken or wrong gets a row that says so, and no ratio."""

import sys
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.competitors import OURS, Competitor, competitors
from benchmarks.native import Unavailable
from benchmarks.process import DroppedOut, SolverProcess, pinned
from benchmarks.race import Bench, Entry, Rules, _Runners, least_seconds, race_covariances, race_solves
from benchmarks.results import covariance_rows, scaling_rows, solve_rows
from benchmarks.statistics import exponent, paired_ratio
from benchmarks.targets import target_rows

SOLVE_COLUMNS = (
    "problem,n_keyframes,n_landmarks,n_observations,solver,gauge,threads,iterations,ms_total,"
    "ms_per_iteration,ratio_to_gtsam,ratio_to_ceres"
)


@pytest.fixture
def ours() -> Competitor:
    return Competitor(
        OURS, (sys.executable, "-m", "benchmarks.worker", OURS), False, ("free",), {"free": "-"}
    )


def no_program(folder: Path) -> Path:
    raise Unavailable("native Ceres is left out: not compiled in this test")


def row_of(rows: list[dict], solver: str) -> dict:
    (row,) = [row for row in rows if row["solver"] == solver]
    return row


def test_agreeing_peer_gets_a_ratio(bench: Bench, ours, fake):
    """Catches ratios upside down: a peer at 0.1 s an iteration against our milliseconds is above one."""
    entries = race_solves(bench, [ours, fake("honest")], 1, ("free",))
    rows = solve_rows("x", bench.problem, entries)
    assert list(rows[0])[:12] == SOLVE_COLUMNS.split(",")
    mine, theirs = row_of(rows, OURS), row_of(rows, "ceres")
    assert theirs["status"] == "measured" and theirs["ms_per_iteration"] == pytest.approx(100.0)
    assert mine["ratio_to_ceres"] > 1.0
    assert mine["ratio_to_ceres"] == pytest.approx(100.0 / mine["ms_per_iteration"], rel=0.5)
    assert mine["ratio_to_ceres_low"] <= mine["ratio_to_ceres"] <= mine["ratio_to_ceres_high"]
    assert mine["ratio_to_gtsam"] == ""
    assert theirs["ratio_to_ceres"] == 1.0
    assert mine["rounds"] == 3


def test_late_peer_drops_out(bench: Bench, ours, fake, said):
    """Catches a suite that waits for ever, or a time made of the limit."""
    race_solves(bench, [ours], 1, ("free",))  # compiled, so that ours is not the late one
    quick = replace(bench, rules=replace(bench.rules, limit_s=10.0))
    entries = race_solves(quick, [ours, fake("slow")], 1, ("free",))
    theirs = row_of(solve_rows("x", bench.problem, entries), "ceres")
    assert theirs["status"] == "over 10 s"
    assert theirs["ms_total"] == theirs["ms_per_iteration"] == theirs["iterations"] == ""
    mine = row_of(solve_rows("x", bench.problem, entries), OURS)
    assert mine["status"] == "measured" and mine["ratio_to_ceres"] == ""
    assert any("over 10 s" in line for line in said)


@pytest.mark.skipif(sys.platform != "linux", reason="memory limits are Linux's")
def test_greedy_peer_drops_out(bench: Bench, ours, fake):
    """Catches a peer that takes the machine down with it."""
    entries = race_solves(
        replace(bench, rules=replace(bench.rules, memory_gib=4.0)), [ours, fake("greedy")], 1, ("free",)
    )
    assert row_of(solve_rows("x", bench.problem, entries), "ceres")["status"] == "over 4 GiB"


def test_broken_peer_says_why(bench: Bench, ours, fake):
    """Catches a crash that looks like a result, or takes the others with it."""
    entries = race_solves(bench, [fake("dies"), ours], 1, ("free",))
    rows = solve_rows("x", bench.problem, entries)
    assert row_of(rows, "ceres")["status"] == "failed: no licence found"
    assert row_of(rows, OURS)["status"] == "measured"


def test_absent_peer_has_a_row(bench: Bench, ours, fake):
    """Catches a peer that silently is not in the table."""
    absent = replace(fake("honest"), absent="is not installed")
    rows = solve_rows("x", bench.problem, race_solves(bench, [ours, absent], 1, ("free",)))
    assert row_of(rows, "ceres")["status"] == "not installed"


def test_disagreement_yields_no_ratio(bench: Bench, ours, fake, said):
    """Catches a fast wrong answer that counts: velocities 1 mm/s off raise the cost by more than 1e-6."""
    entries = race_solves(bench, [ours, fake("wrong")], 1, ("free",))
    rows = solve_rows("x", bench.problem, entries)
    theirs = row_of(rows, "ceres")
    assert theirs["status"] == "differs"
    assert theirs["ms_per_iteration"] == theirs["ratio_to_ceres"] == ""
    assert float(theirs["cost_excess"]) > 1e-6
    assert row_of(rows, OURS)["ratio_to_ceres"] == ""
    assert any("above the lowest" in line for line in said)


def test_we_may_differ_too(bench: Bench, ours, fake):
    """Catches a judge that takes our answer for the truth: here ours is the worse one."""
    wrong = replace(fake("wrong"), name=OURS)
    entries = race_solves(bench, [wrong, fake("honest")], 1, ("free",))
    assert {entry.solver: entry.status for entry in entries} == {OURS: "differs", "ceres": "measured"}


def test_wrong_covariance_yields_no_ratio(bench: Bench, ours, fake):
    """Catches an identity matrix that passes for a covariance."""
    entries = race_covariances(bench, [ours, fake("honest", "pinv")], bench.problem.initial, 1, {})
    rows = covariance_rows("x", bench.problem, entries)
    assert row_of(rows, "pinv")["status"] == "differs"
    assert row_of(rows, OURS)["ratio_to_pinv"] == "" and row_of(rows, OURS)["status"] == "measured"
    assert {"ratio_to_pinv", "ratio_to_marginals"} < set(rows[0])


def test_hopeless_covariance_is_not_tried(bench: Bench, ours, fake, said):
    """Catches two minutes spent on what was late at a smaller size already."""
    known = {"pinv free whole": 121.0}
    entries = race_covariances(bench, [ours, fake("slow", "pinv")], bench.problem.initial, 1, known)
    assert entries[1].status.startswith("not tried: over 120 s")
    late = Entry("gtsam", "prior", 1, status="over 20 s", part="blocks")
    assert least_seconds([late, entries[1], Entry(OURS, "free", 1, trial_s=2.0, part="whole")]) == {
        "gtsam prior blocks": float("inf"),
        "pinv free whole": float("inf"),
        f"{OURS} free whole": 2.0,
    }


def test_short_runs_are_repeated_in_a_turn():
    """Catches single runs with cold caches, and turns that take longer for slow solvers."""
    rules = Rules(turn_s=0.05)
    assert [rules.runs(seconds) for seconds in (0.0, 1e-3, 5e-3, 0.03, 2.0)] == [1001, 51, 11, 1, 1]


def test_slow_solvers_run_less_often():
    """Catches rounds that make the whole suite as slow as its slowest member allows."""
    rules = Rules(budget_s=20.0, rounds=25)
    assert [rules.count(seconds) for seconds in (1e-3, 1.0, 10.0, 30.0)] == [25, 20, 3, 1]


def test_threads_are_pinned(bench: Bench, ours):
    """Catches a solver with more cores than its row says."""
    assert pinned(1)["OPENBLAS_NUM_THREADS"] == pinned(1)["NUMBA_NUM_THREADS"] == "1"
    if not hasattr(__import__("os"), "sched_getaffinity"):
        pytest.skip("no affinity on this system")
    script = (
        "import os, json; print(json.dumps({'cores': len(os.sched_getaffinity(0))}), flush=True); input()"
    )
    process = SolverProcess([sys.executable, "-c", script], 1, limit_s=20.0, memory_gib=4.0)
    with process:
        assert process.first == {"cores": 1}


def test_blas_stays_at_one_thread_where_our_loops_have_two(bench: Bench, tmp_path, monkeypatch):
    """Catches two pools of two threads on two cores, which mostly wait for each other."""
    script = tmp_path / "environment.py"
    script.write_text(
        "import json, os; print(json.dumps({'blas': os.environ['OPENBLAS_NUM_THREADS'],"
        " 'numba': os.environ['NUMBA_NUM_THREADS']}), flush=True); input()",
        encoding="utf-8",
    )
    monkeypatch.setattr("benchmarks.competitors.build", no_program)
    ours = next(c for c in competitors(tmp_path) if c.name == OURS)
    with ExitStack() as stack:
        process = _Runners(bench, 2, stack).of(replace(ours, command=(sys.executable, str(script))))
    assert process.first == {"blas": "1", "numba": "2"}


def test_a_solver_that_does_not_start_drops_out():
    """Catches a command that is not there, or a start-up failure, as an exception of another kind."""
    with pytest.raises(DroppedOut, match="failed"):
        SolverProcess([sys.executable, "-c", "raise SystemExit('bad')"], 1, limit_s=20.0, memory_gib=4.0)


def test_paired_ratio():
    """Catches ratios of medians instead of medians of ratios, and intervals out of one round."""
    value, low, high = paired_ratio([2.0, 8.0, 3.0], [1.0, 2.0, 1.0])
    assert value == 3.0 and 2.0 <= low <= 3.0 <= high <= 4.0
    once = paired_ratio([6.0], [2.0])
    assert once[0] == 3.0 and all(end != end for end in once[1:])
    assert paired_ratio([6.0], [2.0, 2.0, 3.0])[0] == 3.0
    with pytest.raises(ValueError, match="no round"):
        paired_ratio([], [1.0])


def test_exponent():
    """Catches a slope over decades or over seconds instead of log over log."""
    assert exponent([100, 300, 1000], [5.0, 15.0, 50.0]) == pytest.approx(1.0)
    assert exponent([10, 100], [1.0, 100.0]) == pytest.approx(2.0)
    assert exponent([10], [1.0]) != exponent([10], [1.0])  # nan


def scaling_example() -> list[dict]:
    row = {"solver": OURS, "gauge": "free", "threads": 1, "peak_mib": 512.0}
    times = {10: 1.0, 100: 20.0, 1000: 400.0}
    solves = [
        row
        | {"problem": f"n{n}", "n_keyframes": n, "n_landmarks": 5 * n, "n_observations": 9 * n}
        | {"ms_per_iteration": ms}
        for n, ms in times.items()
    ]
    solves.append(solves[0] | {"solver": "scipy", "ms_per_iteration": ""})
    # Denser: no part of the growth with N alone.
    solves.append(solves[2] | {"problem": "n1000b", "n_landmarks": 10**4, "n_observations": 18 * 10**3})
    return scaling_rows(solves, {row["problem"]: 1e-4 * row["n_keyframes"] for row in solves})


def test_scaling_rows():
    """Catches an exponent over short problems, whose times are overhead, and shares above one."""
    rows = scaling_example()
    assert [row["n_keyframes"] for row in rows] == [10, 100, 1000, 1000]
    assert rows[0]["exponent_keyframes"] == pytest.approx(1.301, abs=1e-3)
    assert rows[0]["exponent_observations"] < 1.301
    assert rows[2]["share_of_floor"] == pytest.approx(100.0 / 400.0)


def test_targets_are_judged():
    """Catches verdicts the wrong way round, and a missing measurement that passes."""
    covariance = {
        "solver": OURS, "threads": 1, "n_keyframes": 10, "gauge": "free", "part": "whole",
        "ratio_to_pinv": 500.0, "ratio_to_marginals": 30.0, "ratio_to_fixed": 0.8,
    }  # fmt: skip
    rows = {r["quantity"]: r for r in target_rows([], [covariance], scaling_example(), [], {"start_s": 0.5})}
    assert rows["free motion covariance, N = 10, against pinv"]["verdict"] == "reached"
    assert rows["free over fixed covariance time, N = 10"]["measured"] == 1.25
    assert rows["free over fixed covariance time, N = 10"]["verdict"] == "reached"
    assert rows["growth of an iteration with N (exponent)"]["verdict"] == "short"
    assert rows["N = 1000, memory, GiB"]["verdict"] == "moonshot"
    assert rows["process that solves one problem, s"]["verdict"] == "moonshot"
    assert rows["whole paper, s"]["verdict"] == "not measured"
    assert rows["iteration, N = 10, against gtsam"]["verdict"] == "not measured"


def test_targets_with_biases_are_those_of_the_slowest_gauge():
    """Catches a gauge that falls short behind one that does not, a row of known biases taken for one with
    them, and a peer that was not there called reached."""

    def row(biases: str, gauge: str, ms: float, ceres: float | str) -> dict:
        return {
            "biases": biases, "solver": OURS, "n_keyframes": 10, "gauge": gauge, "ms_per_iteration": ms,
            "ratio_to_gtsam": "", "ratio_to_ceres": ceres, "ratio_to_ceres_low": 4.5,
            "ratio_to_ceres_high": 5.5,
        }  # fmt: skip

    solves = [
        row("estimated", "fix", 0.2, 6.0),
        row("estimated", "free", 0.3, 4.9),
        row("known", "fix", 0.15, 9.0),
        row("known", "free", 0.1, ""),
    ]
    rows = {r["quantity"]: r for r in target_rows([], [], [], solves, {})}
    ceres = rows["iteration with biases, N = 10, against ceres"]
    assert (ceres["measured"], ceres["interval"], ceres["verdict"]) == (4.9, "4.5 to 5.5", "short")
    assert rows["iteration with biases, N = 10, against gtsam"]["verdict"] == "not measured"
    known = rows["iteration with biases, N = 10, over known biases"]
    assert (known["measured"], known["verdict"]) == (3.0, "short")
