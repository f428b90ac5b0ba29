"""Run the workflow, taking up what a killed run left: stale locks, half-made files.

Arguments are those of Snakemake. A folder in which a run is going on is left alone, be it here or in the
queue of Slurm; so is one whose run was started on another machine, which cannot be seen from here.
"""

import argparse
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import NoReturn

import psutil
import yaml

from vigauge.cli.command import EXIT_BAD_INPUT
from vigauge.files import write_text

# Holds the name of the machine on which the last run of a folder was started.
_STARTED_ON = Path(".snakemake", "started_on")


def runs_in(folder: Path) -> list[str]:
    """What of the workflow is at work in a folder, this process and its parents apart."""
    return [*_slurm_jobs(folder), *_processes(folder)]


def _slurm_jobs(folder: Path) -> list[str]:
    """Jobs that run or wait in Slurm and were submitted from a folder; they outlive Snakemake."""
    if not (folder / ".snakemake" / "slurm_logs").is_dir() or not shutil.which("squeue"):
        return []
    queue = ["squeue", "--me", "--noheader", "--format", "%i %T %Z"]
    told = subprocess.run(queue, capture_output=True, text=True, check=False)
    if told.returncode:
        return [f"or may be: squeue fails: {told.stderr.strip()}"]
    jobs = [line.split(" ", 2) for line in told.stdout.splitlines()]
    return [f"Slurm job {job}, {state.lower()}" for job, state, place in jobs if Path(place) == folder]


def _processes(folder: Path) -> list[str]:
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


def missing_executor(arguments: Sequence[str]) -> str:
    """The executor that a run or its workflow profile asks for, where its plugin is not installed."""
    options = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    options.add_argument("--executor", "-e")
    options.add_argument("--workflow-profile", type=Path, default=Path("default"))
    asked, _ = options.parse_known_args(arguments)
    executor = asked.executor
    files = [
        folder / "config.yaml" for folder in (asked.workflow_profile, "profiles" / asked.workflow_profile)
    ]
    if profile := next((file for file in files if file.is_file()), None):
        executor = executor or (yaml.safe_load(profile.read_text("utf-8")) or {}).get("executor")
    own = executor in (None, "local", "dryrun", "touch")
    return (
        "" if own or find_spec(f"snakemake_executor_plugin_{executor.replace('-', '_')}") else str(executor)
    )


def _refuse(sentence: str) -> NoReturn:
    sys.stderr.write(f"error: {sentence}\n")
    sys.exit(EXIT_BAD_INPUT)


def main() -> None:
    folder = Path.cwd().resolve()
    if executor := missing_executor(sys.argv[1:]):
        _refuse(
            f"the run asks for the executor {executor!r}, whose plugin is not installed:"
            f" {sys.executable} -m pip install snakemake-executor-plugin-{executor}"
        )
    running = runs_in(folder)
    if running:
        others = f", and {len(running) - 1} more" if running[1:] else ""
        _refuse(f"a run is going on in {folder} ({running[0]}{others}); wait until it has ended")
    snakemake = [sys.executable, "-m", "snakemake"]
    arguments = sys.argv[1:]
    locks = folder / ".snakemake" / "locks"
    here, started_on = platform.node(), folder / _STARTED_ON
    if locks.is_dir() and any(locks.iterdir()):
        there = started_on.read_text("utf-8") if started_on.is_file() else here
        if there != here:
            _refuse(
                f"{folder} is locked by a run that was started on {there}; start this command there, "
                "or, where that run has ended, `snakemake --unlock` before it"
            )
        # Nobody is at work here, so the lock is what a killed run left.
        unlocked = subprocess.run([*snakemake, "--unlock", *arguments], check=False)
        if unlocked.returncode:
            sys.exit(unlocked.returncode)
    write_text(started_on, here)
    os.execv(sys.executable, [*snakemake, "--rerun-incomplete", *arguments])


if __name__ == "__main__":
    main()
