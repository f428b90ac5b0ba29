"""A stage whose output cannot be written: one clear line, exit status 2, nothing corrupted."""

import errno
import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import pytest

from support.simulated import SETTINGS
from vigauge.errors import OutputError
from vigauge.files import atomic_path, write_text

LIMIT = 20_000  # bytes; the problems take more
_ROOT = os.geteuid() == 0


def simulate(folder: Path, before: Callable[[], None] | None = None) -> subprocess.CompletedProcess[str]:
    """Run the stage `simulate` on small settings; ``before`` runs in the child."""
    settings = json.dumps(asdict(SETTINGS))
    flags = ["--trajectory", "sine", "--points", "plane", "--settings", settings]
    for name in ("problems.npz", "truth.npz", "path.csv", "report.json"):
        flags += [f"--{Path(name).stem}", str(folder / name)]
    flags += ["--stamp", str(folder / "stamp.json"), "--log", str(folder / "logs" / "simulate.log")]
    command = [sys.executable, "-m", "vigauge_paper.commands.simulate", *flags]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, preexec_fn=before)


def error_line(done: subprocess.CompletedProcess[str]) -> str:
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    return line


def test_a_full_disk_leaves_the_old_result(tmp_path: Path) -> None:
    """Half an archive, or a new one beside old ones. The size limit of a process stands in for the disk."""
    (tmp_path / "problems.npz").write_text("old", encoding="utf-8")
    done = simulate(tmp_path, lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, LIMIT)))
    line = error_line(done)
    assert f"{tmp_path / 'problems.npz'}: cannot be written: File too large; nothing was changed" in line
    assert (tmp_path / "problems.npz").read_text("utf-8") == "old"
    assert {path.name for path in tmp_path.iterdir()} == {"problems.npz", "logs"}


def test_no_space_left_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The error of a disk that is full, at the moment of writing and at that of closing."""
    target = tmp_path / "result.txt"
    target.write_text("old", encoding="utf-8")

    def full(*arguments: object, **options: object) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(
        OutputError, match=r"result\.txt: cannot be written: No space left on device; nothing"
    ):
        write_text(target, "new")
    monkeypatch.undo()
    with pytest.raises(OutputError, match="No space left"), atomic_path(target) as temporary:
        temporary.write_text("half", encoding="utf-8")
        full()
    assert target.read_text("utf-8") == "old"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.skipif(_ROOT, reason="root may write everywhere")
def test_a_folder_without_permission_is_named(tmp_path: Path) -> None:
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o555)
    assert "Permission denied" in error_line(simulate(folder / "made"))


def test_an_output_below_a_file_is_named(tmp_path: Path) -> None:
    """A read-only output in a form that holds for every user, root included."""
    (tmp_path / "file").write_text("", encoding="utf-8")
    assert "file/logs/simulate.log: cannot be written: Not a directory" in error_line(
        simulate(tmp_path / "file")
    )
    assert (tmp_path / "file").read_text("utf-8") == ""


def test_leftovers_of_a_killed_writer_are_removed(tmp_path: Path) -> None:
    """Hidden files that pile up, or one of a writer that is still at work being taken away."""
    gone = subprocess.run(
        [sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True
    )
    dead = tmp_path / f".result.{int(gone.stdout)}.csv"
    living = tmp_path / f".result.{os.getppid()}.csv"
    other = tmp_path / f".result.x.{int(gone.stdout)}.csv"
    for file in (dead, living, other):
        file.write_text("half", encoding="utf-8")
    write_text(tmp_path / "result.csv", "whole")
    assert {path.name for path in tmp_path.iterdir()} == {"result.csv", living.name, other.name}
