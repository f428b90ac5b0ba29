"""A window through everything: solved with all figures, or refused where and why."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from vigauge.recordings.frontend.settings import FrontEndSettings
from vigauge.solver.levenberg_marquardt import Options
from vigauge_paper.experiments.windows import COMPARED, WindowTask, run_window, summarise
from vigauge_paper.stand_in.asl_folder import write_asl_folder
from vigauge_paper.stand_in.rendering import RenderSettings, render_sequence

TRUTH = "state_groundtruth_estimate0"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("windows") / "room"
    write_asl_folder(render_sequence("room", RenderSettings(seed=7, duration_s=1.5)), "room", folder, {})
    return folder


def task(folder: Path, truth: str = TRUTH, **keyframes: object) -> WindowTask:
    settings = FrontEndSettings.from_mapping(
        {"tracker": "descriptors", "keyframes": {"count": 4} | keyframes, "descriptors": {"features": 600}}
    )
    noise = {"headline": {"sigma_px": 0.3, "density_factor": 1.0}}
    return WindowTask("w", folder, truth, truth, settings, noise)


def test_window_gives_errors_iterations_and_distances_of_three_gauges(folder: Path) -> None:
    """A column that is filled from another gauge, or the start's errors in place of the optimum's."""
    rows = run_window(task(folder, window_start_s=0.3), Options(), 1e5)
    assert [row["gauge"] for row in rows] == ["fix", "prior", "free"]
    for row in rows:
        assert row["converged"] is True and row["stopped_at"] == "" and row["why"] == ""
        assert 0 < row["p_rmse_m"] < row["start_p_rmse_m"] < 0.05
        assert 0 < row["v_rmse_mps"] < row["start_v_rmse_mps"]
        assert row["relative_frobenius_same_point"] < 1e-9
        assert 0 < row["relative_frobenius_converged"] < 0.05
        assert row["keyframes"] == 4 and row["landmarks"] > 50


@pytest.mark.parametrize(
    ("change", "stage", "words"),
    [
        ({"truth": "state_groundtruth_nowhere0"}, "check", "file must exist"),
        ({"count": 20}, "front-end", "DataError: frames: the window"),
        ({"window_start_s": 90.0}, "check", "frames lie in the window"),
    ],
)
def test_refused_window_says_where_and_why(folder: Path, change: dict, stage: str, words: str) -> None:
    """Not-a-number, or an empty cell, in place of a reason."""
    if "count" in change:
        change = change | {"window_start_s": 1.0}
    (row,) = run_window(task(folder, **change), Options(), 1e5)
    assert row["stopped_at"] == stage and words in str(row["why"])
    assert row["gauge"] == "" and row["p_rmse_m"] == ""


def test_fault_of_the_recording_stops_before_the_front_end(folder: Path, tmp_path: Path) -> None:
    spoilt = Path(shutil.copytree(folder, tmp_path / "room"))
    path = spoilt / "mav0" / "imu0" / "data.csv"
    rows = path.read_text().splitlines()
    path.write_text("\n".join(rows[:400] + rows[450:]) + "\n")
    (row,) = run_window(task(spoilt), Options(), 1e5)
    assert row["stopped_at"] == "check" and "imu gap" in str(row["why"])


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
