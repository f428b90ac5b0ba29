"""Run the workflow, taking up what a killed run left: stale locks, half-made files.

Arguments are those of Snakemake. A folder in which a run is going on is left alone.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import psutil

from vigauge.cli.command import EXIT_BAD_INPUT


def runs_in(folder: Path) -> list[str]:
    """Processes of the workflow that work in a folder, this one and its parents apart."""
    own = {process.pid for process in (psutil.Process(), *psutil.Process().parents())}
    found = []
    for process in psutil.process_iter():
        try:
            words = process.cmdline()
            if process.pid in own or process.status() == psutil.STATUS_ZOMBIE:
                continue
            if _is_workflow(words) and Path(process.cwd()) == folder:
                found.append(f"process {process.pid}: {' '.join(words)[:80]}")
        except (psutil.NoSuchProcess, psutil.AccessDenied):
            continue  # it has ended meanwhile, or is another user's, who has another folder
    return found


def _is_workflow(words: list[str]) -> bool:
    """Whether a command line is Snakemake's, or that of a stage."""
    programs = [Path(word).name for word in words[:4]]
    stages = any(word.startswith(("vigauge_paper.commands.", "vigauge.cli.")) for word in words[:4])
    return "snakemake" in programs or stages


def main() -> None:
    folder = Path.cwd().resolve()
    running = runs_in(folder)
    if running:
        sys.stderr.write(f"error: a run is going on in {folder} ({running[0]}); wait until it has ended\n")
        sys.exit(EXIT_BAD_INPUT)
    snakemake = [sys.executable, "-m", "snakemake"]
    arguments = sys.argv[1:]
    locks = folder / ".snakemake" / "locks"
    if locks.is_dir() and any(locks.iterdir()):
        # Nobody is at work here, so the lock is what a killed run left.
        unlocked = subprocess.run([*snakemake, "--unlock", *arguments], check=False)
        if unlocked.returncode:
            sys.exit(unlocked.returncode)
    os.execv(sys.executable, [*snakemake, "--rerun-incomplete", *arguments])


if __name__ == "__main__":
    main()
