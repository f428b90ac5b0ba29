"""Starting again after a kill: what counts as a run that is still going on."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from vigauge_paper.commands.resume import runs_in

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
