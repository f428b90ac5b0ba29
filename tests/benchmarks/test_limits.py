"""Floors and where time goes: counts against direct ones, records against made-up ones."""

import json

import numpy as np
import pytest

from benchmarks.__main__ import chosen_sizes, main
from benchmarks.limits import Peak, Stage, iteration_stages, measure_peak, pair_counts
from benchmarks.paper_time import job_records, rule_rows, whole_paper_s
from benchmarks.problems import Size, make_problem
from benchmarks.profile_solve import profile, stage_seconds
from benchmarks.results import roofline_rows
from vigauge.errors import DataError
from vigauge.files import write_rows


def test_pairs_are_counted(small):
    """Catches a Schur product counted over observations or over all keyframes."""
    problem, _ = small
    pairs, products, reach = 0, 0, 0
    for j in range(problem.initial.n_landmarks):
        seen = np.unique(problem.obs_keyframe[problem.obs_landmark == j])
        pairs += len(seen)
        products += len(seen) * (len(seen) + 1) // 2
        reach = max(reach, int(np.ptp(seen)))
    assert pair_counts(problem) == (pairs, products, reach)


def test_floor_grows_with_the_flight():
    """Catches a floor that treats a long problem's system as dense: twice as long, twice the work."""
    peak = Peak(5e10, 1e10)
    floor = [
        sum(stage.floor_s(peak) for stage in iteration_stages(make_problem(Size(n, 10 * n))))
        for n in (40, 80)
    ]
    assert floor[1] / floor[0] == pytest.approx(2.0, rel=0.1)


def test_a_stage_is_bound_by_the_slower_of_two():
    """Catches a floor that adds, or takes the faster."""
    assert Stage("x", 10.0, 1.0).floor_s(Peak(5.0, 1.0)) == 2.0
    assert Stage("x", 1.0, 3.0).floor_s(Peak(5.0, 1.0)) == 3.0


def test_peak_is_that_of_a_computer():
    """Catches units off by thousands."""
    peak = measure_peak(order=300, length=200_000)
    assert 1e8 < peak.flops < 1e13 and 1e8 < peak.bandwidth < 1e13


def test_profile_adds_up(small):
    """Catches shares of something else than the solve."""
    rows = profile(small[1][0])
    assert rows and 0.3 < sum(row["share"] for row in rows) <= 1.001
    assert [row["own_ms"] for row in rows] == sorted((row["own_ms"] for row in rows), reverse=True)


def test_stages_are_those_of_the_floor(small):
    """Catches a stage that is set against another one's floor, or a time that is not its own."""
    problem = small[0]
    seconds = stage_seconds(problem)
    assert list(seconds) == [stage.name for stage in iteration_stages(problem)]
    assert all(0.0 <= value < 1.0 for value in seconds.values()) and seconds["linearise"] > 0.0
    measured = dict.fromkeys(seconds, 2e-3)
    rows = roofline_rows("x", problem, iteration_stages(problem), Peak(1e9, 1e9), measured)
    assert all(row["ours_ms"] == 2.0 for row in rows)
    assert all(row["ours_over_floor"] == pytest.approx(2.0 / row["floor_ms"], rel=1e-2) for row in rows)


def record(rule: str, begin: float, end: float) -> dict:
    return {"rule": rule, "starttime": begin, "endtime": end}


def test_paper_time_counts_jobs_once(tmp_path):
    """Catches a job counted by its outputs, old records of an earlier run, and unfinished ones."""
    records = [
        record("solve", 10.0, 14.0),
        record("solve", 10.0, 14.0),  # its second output
        record("solve", 11.0, 13.0),
        record("table", 14.0, 15.0),
        record("table", 1.0, 9.0),
        {"rule": "table", "starttime": None, "endtime": None},
    ]
    folder = tmp_path / "metadata" / "deep"
    folder.mkdir(parents=True)
    for number, entry in enumerate(records):
        (folder / str(number)).write_text(json.dumps(entry), encoding="utf-8")
    rows = rule_rows(job_records(tmp_path / "metadata"), since=9.5, wall_s=6.0)
    assert [(row["rule"], row["jobs"], row["seconds"]) for row in rows] == [
        ("solve", 2, 6.0),
        ("table", 1, 1.0),
        ("(whole paper)", 3, 6.0),
    ]
    file = tmp_path / "paper.csv"
    assert whole_paper_s(file) is None
    write_rows(file, rows)
    assert whole_paper_s(file) == 6.0
    write_rows(file, rows[:1])
    with pytest.raises(DataError, match="whole paper"):
        whole_paper_s(file)
    with pytest.raises(DataError, match="must have run"):
        job_records(tmp_path / "nothing")


def test_sizes_by_name():
    """Catches a size that nobody knows, run as something else."""
    assert chosen_sizes("small") == [Size(10, 300), Size(30, 1000)]
    assert chosen_sizes("10,1000") == [Size(10, 300), Size(1000, 100000)]
    for text in ("7", "tiny", ""):
        with pytest.raises(SystemExit):
            main(["--sizes", text])
