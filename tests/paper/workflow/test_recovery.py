"""Runs that are killed, doubled or mixed: the same results, or one clear sentence."""

import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from recovery.compare import differences
from recovery.kill import TIMEOUT_S, disturbed_run
from vigauge.files import write_json

from .conftest import make_project, snakemake

pytestmark = pytest.mark.workflow

# Seconds over which the kills of a test fall: in the first jobs, on a machine of any speed.
SPAN_S = 40.0


def resume(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """What `make paper` runs."""
    env = {key: value for key, value in os.environ.items() if key not in ("EUROC_ROOT", "PYTHONPATH")}
    command = [sys.executable, "-m", "vigauge_paper.commands.resume", "--cores", "2", *arguments]
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, timeout=TIMEOUT_S)


@pytest.mark.slow
def test_a_run_killed_twice_gives_the_same_results(tmp_path: Path, smoke_project: Path) -> None:
    """Half-written files that survive a kill, a lock that nobody takes away, or results that depend on
    the interruption. `make recovery` does this more often; docs/recovery.csv has the record."""
    folder = make_project(tmp_path / "project")
    kills = disturbed_run(folder, smoke_project, "smoke", seed=3, kills=2, span_s=SPAN_S)
    assert len(kills) == 2, "the run had ended before it was killed: nothing was tested"
    assert all(kill.identical for kill in kills)


def test_the_comparison_sees_differences(smoke_project: Path, scratch_project: Path) -> None:
    """A comparison that finds everything identical, whatever is there."""
    assert not differences(smoke_project, scratch_project)
    table = scratch_project / "paper_figures" / "table2.csv"
    table.write_text(table.read_text("utf-8").replace("0.0", "0.1", 1), "utf-8")
    iterations = scratch_project / "paper_figures" / "fig07_simulation_cost.csv"
    text = iterations.read_text("utf-8")
    iterations.write_text(re.sub(r"(,iterations,)\d", r"\g<1>9", text, count=1), "utf-8")
    runs = scratch_project / "data" / "timing_reasons" / "biases.csv"
    runs.write_text(runs.read_text("utf-8").replace("tolerance", "limit", 1), "utf-8")
    (scratch_project / "data" / "covariance" / "arc_plane.npz").unlink()
    (scratch_project / "data" / ".half.123.csv").write_text("half", "utf-8")
    assert differences(smoke_project, scratch_project) == [
        "data/.half.123.csv is in one run only",
        "data/covariance/arc_plane.npz is in one run only",
        "data/timing_reasons/biases.csv differs",
        "paper_figures/fig07_simulation_cost.csv differs",
        "paper_figures/table2.csv differs",
    ]


@pytest.mark.slow
def test_two_runs_at_once(tmp_path: Path) -> None:
    """Two runs that write the same files: Snakemake's lock for one command, a sentence for the other."""
    folder = make_project(tmp_path / "project")
    env = {key: value for key, value in os.environ.items() if key not in ("EUROC_ROOT", "PYTHONPATH")}
    first = subprocess.Popen(
        [sys.executable, "-m", "snakemake", "--cores", "1", "--configfile", "config/smoke.yaml"],
        cwd=folder,
        env=env,
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    locks = folder / ".snakemake" / "locks"
    deadline = time.monotonic() + 120
    while not (locks.is_dir() and any(locks.iterdir())) and time.monotonic() < deadline:
        time.sleep(0.05)
    try:
        second = snakemake(folder, "--rerun-incomplete")
        assert second.returncode != 0
        assert "cannot be locked" in second.stdout + second.stderr
        taken = resume(folder, "--configfile", "config/smoke.yaml")
        assert taken.returncode == 2
        assert f"a run is going on in {folder.resolve()} (process {first.pid}" in taken.stderr
        assert first.poll() is None and any(locks.iterdir()), "the first run must go on undisturbed"
    finally:
        os.killpg(first.pid, 9)
        first.wait()
    assert (
        resume(
            folder, "--configfile", "config/smoke.yaml", "--", "data/simulation/arc_plane/truth.npz"
        ).returncode
        == 0
    )


@pytest.mark.slow
def test_a_result_of_another_configuration_is_refused(smoke_project: Path, tmp_path: Path) -> None:
    """Table II of trials under two configurations."""
    other = make_project(tmp_path / "other")
    config = other / "config" / "smoke.yaml"
    config.write_text(config.read_text("utf-8") + "solver:\n  function_tolerance: 1.0e-3\n", "utf-8")
    assert snakemake(other, "data/solutions/arc_plane/solutions.csv").returncode == 0
    folder = Path(shutil.copytree(smoke_project, tmp_path / "project", symlinks=True))
    before = (folder / "paper_figures" / "table2.csv").read_bytes()
    for file in (other / "data" / "solutions" / "arc_plane").iterdir():
        shutil.copyfile(file, folder / "data" / "solutions" / "arc_plane" / file.name)
    done = snakemake(folder, "paper_figures/table2.csv")
    assert done.returncode != 0
    message = done.stdout + done.stderr
    assert "solver.function_tolerance: must be that of" in message
    assert "which has 1e-06; results of two runs are mixed" in message and "(found 0.001)" in message
    assert "MixtureError" not in message and "Traceback" not in message
    # Snakemake takes the old output away before the job; what is there is the old table or none.
    table = folder / "paper_figures" / "table2.csv"
    assert not table.exists() or table.read_bytes() == before


def test_a_result_of_another_version_is_refused(scratch_project: Path) -> None:
    """Results of old code beside those of new, with stamps and all."""
    stamp = scratch_project / "data" / "solutions" / "arc_plane" / "stamp.json"
    write_json(stamp, json.loads(stamp.read_text("utf-8")) | {"code": "0" * 64})
    done = snakemake(scratch_project, "paper_figures/table2.csv")
    assert done.returncode != 0
    assert re.search(r"solutions/\w+/stamp\.json, code: must be that of", done.stdout + done.stderr)


def test_an_edited_result_is_refused(scratch_project: Path) -> None:
    """A number changed by hand between two runs."""
    solutions = scratch_project / "data" / "solutions" / "arc_plane" / "solutions.csv"
    solutions.write_text(solutions.read_text("utf-8").replace("0.0", "0.1", 1), "utf-8")
    done = snakemake(scratch_project, "paper_figures/table2.csv")
    assert done.returncode != 0
    assert "arc_plane/solutions.csv: is not the result that" in done.stdout + done.stderr


@pytest.mark.slow
def test_a_partial_rerun_is_no_mixture(scratch_project: Path) -> None:
    """A stamp of the whole configuration would refuse what was rightly left as it was."""
    config = scratch_project / "config" / "smoke.yaml"
    config.write_text(
        config.read_text("utf-8").replace("repeats_sequence: 3", "repeats_sequence: 2"), "utf-8"
    )
    done = snakemake(scratch_project, "paper_figures/environment.json", "paper_figures/table3.csv")
    assert done.returncode == 0, done.stderr[-3000:]
    assert "Timing the image sequences" in done.stderr
    assert "Timing all simulated configurations" not in done.stderr
