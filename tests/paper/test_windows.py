"""A window's row: all figures of its results, or where and why it was refused."""

from pathlib import Path

import pytest

from vigauge.files import write_json, write_rows
from vigauge_paper.experiments.windows import COMPARED, DISTANCES, summarise, window_rows

SETTINGS = {"start_s": 5.0, "end_s": 8.0, "truth": "state_groundtruth_estimate0"}
GAUGES = ("fix", "prior", "free")
MODELS = ("headline", "consistent")


def solution(noise: str, gauge: str) -> dict[str, object]:
    """Numbers that no other row has, in columns that no other row's are in."""
    first = 100 * (1 + MODELS.index(noise)) + 10 * GAUGES.index(gauge)
    errors = [f"start_{name}" for name in COMPARED] + list(COMPARED)
    row = {"noise": noise, "gauge": gauge, "status": "function tolerance", "converged": True, "cost": 1.5}
    return row | {"iterations": 4} | {name: first + index for index, name in enumerate(errors)}


def covariance(noise: str, withheld: str = "") -> dict[str, object]:
    distances = {name: "nan" if withheld else f"{noise} {name}" for name in DISTANCES}
    return {"noise": noise, "withheld": withheld} | distances


def rows_of(
    data: Path, solutions: list | None = None, covariances: list | None = None, **report: object
) -> list[dict[str, str]]:
    """Rows of a window whose results are written as the rules leave them."""
    write_json(data / "checks/w.json", {"sequence": "room", "errors": [], "warnings": [{}, {}]})
    write_json(data / "sequences/w/report.json", report)
    if solutions is not None:
        write_rows(data / "solutions/w/solutions.csv", solutions)
        write_rows(data / "covariance/w.csv", covariances or [covariance(noise) for noise in MODELS])
    return window_rows(data, "w", SETTINGS)


ALL = [solution(noise, gauge) for noise in MODELS for gauge in GAUGES]


def test_window_gives_errors_iterations_and_distances_of_three_gauges(tmp_path: Path) -> None:
    """A column that is filled from another gauge or noise, or the start's errors for the optimum's."""
    rows = rows_of(tmp_path, ALL, keyframes=4, landmarks=60)
    assert [(row["noise"], row["gauge"]) for row in rows] == [
        (noise, gauge) for noise in ("consistent", "headline") for gauge in GAUGES
    ]
    for row in rows:
        wanted = solution(row["noise"], row["gauge"]) | SETTINGS | covariance(row["noise"])
        wanted |= {"window": "w", "sequence": "room", "keyframes": 4, "landmarks": 60, "check_warnings": 2}
        del wanted["withheld"]
        assert row == {name: str(value) for name, value in wanted.items()} | {"stopped_at": "", "why": ""}


def test_refused_window_says_where_and_why(tmp_path: Path) -> None:
    """Not-a-number, or results that are looked for, in place of a reason."""
    (row,) = rows_of(tmp_path, stopped_at="check", why="standing still")
    assert (row["stopped_at"], row["why"]) == ("check", "standing still")
    assert row["gauge"] == row["p_rmse_m"] == row["keyframes"] == "" and row["end_s"] == "8.0"


def test_runs_without_convergence_and_withheld_covariances_have_no_distances(tmp_path: Path) -> None:
    """Distances of a covariance that does not exist; one noise model's fault told of the other."""
    failed = [
        row | ({"converged": False, "status": "iteration limit"} if row["noise"] == "headline" else {})
        for row in ALL
    ]
    rows = rows_of(tmp_path, failed, [covariance("headline", "x"), covariance("consistent", "degenerate")])
    assert {(row["noise"], row["stopped_at"], row["why"]) for row in rows} == {
        ("consistent", "covariance", "degenerate"),
        ("headline", "solve", "fix: iteration limit; prior: iteration limit; free: iteration limit"),
    }
    assert {row[name] for row in rows for name in DISTANCES} == {""}
    assert all(row["p_rmse_m"] for row in rows)


def row_of(start: float, end: float, converged: bool = True) -> dict[str, str]:
    values = {name: str(end) for name in COMPARED} | {f"start_{name}": str(start) for name in COMPARED}
    return values | {"gauge": "free", "noise": "headline", "converged": str(converged)}


def test_summary_pairs_windows_and_counts_what_it_leaves_out() -> None:
    """Means of unpaired errors, or failed runs averaged in."""
    rows = [row_of(2.0, 1.0), row_of(8.0, 2.0), row_of(1.0, 3.0), row_of(1.0, 900.0, converged=False)]
    summary = summarise([*rows, {"gauge": "", "noise": "", "converged": ""}])
    assert [row["error"] for row in summary] == list(COMPARED)
    first = summary[0]
    assert (first["windows"], first["left_out"], first["optimum_nearer"]) == (3, 1, 2)
    assert first["median_ratio"] == 0.5
    assert first["sign_test_p"] == pytest.approx(1.0)


def test_nothing_solved_gives_no_summary() -> None:
    assert summarise([{"gauge": "", "noise": "", "converged": ""}]) == []
