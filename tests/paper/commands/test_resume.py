"""Starting again after a kill: what counts as a run that is still going on."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from vigauge_paper.commands.resume import missing_executor, runs_in

# A process that does nothing, under the command line of another.
SLEEP = "import sys, time; sys.stdout.write('here'); sys.stdout.flush(); time.sleep(120)"


@contextmanager
def process(folder: Path, *words: str) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-c", SLEEP, *words]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True) as sleeper:
        assert sleeper.stdout is not None and sleeper.stdout.read(4) == "here"
        try:
            yield sleeper
        finally:
            sleeper.kill()


@pytest.mark.parametrize("word", ["snakemake", "vigauge_paper.commands.solve"])
def test_an_orphan_of_a_killed_run_is_waited_for(tmp_path: Path, word: str) -> None:
    """Jobs that outlive Snakemake write the files that the next run makes again."""
    folder = tmp_path.resolve()
    assert runs_in(folder) == []
    with process(folder, word) as sleeper:
        (found,) = runs_in(folder)
        assert found.startswith(f"process {sleeper.pid}: ")
        (folder / "other").mkdir()
        assert runs_in(folder / "other") == []
        command = [sys.executable, "-m", "vigauge_paper.commands.resume", "--cores", "1"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        assert done.returncode == 2
        assert done.stderr.startswith(f"error: a run is going on in {folder} (process {sleeper.pid}")
    assert runs_in(folder) == []


def test_other_programs_of_the_folder_are_none(tmp_path: Path) -> None:
    """An editor or a shell that is open in the project."""
    with process(tmp_path.resolve(), "Snakefile", "snakemake.log"):
        assert runs_in(tmp_path.resolve()) == []


@pytest.mark.parametrize("asked", [("--workflow-profile", "profiles/far"), ("--executor", "far")])
def test_an_executor_that_is_not_installed_is_one_sentence(tmp_path: Path, asked: tuple[str, str]) -> None:
    """Catches a hundred lines of usage that never say what to install."""
    (tmp_path / "profiles" / "far").mkdir(parents=True)
    (tmp_path / "profiles" / "far" / "config.yaml").write_text("executor: far\n", "utf-8")
    command = [sys.executable, "-m", "vigauge_paper.commands.resume", *asked]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    (sentence,) = done.stderr.splitlines()
    assert done.returncode == 2 and sentence.startswith("error: ")
    assert sentence.endswith("-m pip install snakemake-executor-plugin-far")
    assert missing_executor(["--executor", "local", "--cores", "1"]) == ""


def resume(folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "vigauge_paper.commands.resume", "--cores", "1"]
    return subprocess.run(command, cwd=folder, env=os.environ | environment, capture_output=True, text=True)


@pytest.mark.parametrize(
    ("squeue", "sentence"),
    [
        ("echo 7 RUNNING {folder}; echo 8 PENDING {folder}", "(Slurm job 7, running, and 1 more)"),
        ("echo no controller >&2; exit 1", "(or may be: squeue fails: no controller)"),
        ("echo 9 RUNNING {folder}/other", None),
    ],
)
def test_jobs_of_a_killed_run_that_are_in_the_queue_are_waited_for(
    tmp_path: Path, squeue: str, sentence: str | None
) -> None:
    """Catches a lock that is taken away while Slurm still holds jobs, which are then submitted twice."""
    folder = tmp_path.resolve() / "project"
    (folder / ".snakemake" / "slurm_logs").mkdir(parents=True)
    program = tmp_path / "squeue"
    program.write_text("#!/bin/sh\n" + squeue.format(folder=folder) + "\n", "utf-8")
    program.chmod(0o755)
    done = resume(folder, PATH=f"{tmp_path}:{os.environ['PATH']}")
    if sentence is None:
        assert "a run is going on" not in done.stderr
    else:
        assert done.returncode == 2
        assert done.stderr == f"error: a run is going on in {folder} {sentence}; wait until it has ended\n"


def test_a_lock_of_another_machine_stays(tmp_path: Path) -> None:
    """Catches a second run in a shared folder: processes of another login node cannot be seen."""
    state = tmp_path.resolve() / ".snakemake"
    (state / "locks").mkdir(parents=True)
    (state / "locks" / "0.input.lock").write_text("a.csv\n", "utf-8")
    (state / "started_on").write_text("login7", "utf-8")
    done = resume(tmp_path.resolve())
    assert done.returncode == 2 and "run that was started on login7; start this command there" in done.stderr
    assert (state / "locks" / "0.input.lock").is_file()
