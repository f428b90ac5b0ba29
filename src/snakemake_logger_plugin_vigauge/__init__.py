"""What a run of the workflow says on the terminal: a line to begin, one a stage, four where one fails.

`profiles/default` chooses it. The rest of what Snakemake says, reasons included, is in the log of the run
under `.snakemake/log`; a dry run prints what Snakemake prints.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import sys
from itertools import takewhile
from logging import WARNING
from pathlib import Path
from threading import Event, Thread
from time import time
from typing import Any

from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

# How a stage, a check, an argument parser, Python and the shell begin the line that says why they give up.
_ERROR = re.compile(r"(^|: )error( \[[\w -]+\])?: |^[\w.]+(Error|Exception|Interrupt)\b|\bKilled\b")
# What a stage logs every few seconds of long work.
_SHARE = re.compile(r": (\d+) of (\d+) ")
# Snakemake says these at the end; the failure is told where it happens.
_TOLD = re.compile(
    r"Exiting because a job execution failed|At least one job did not complete|CalledProcessError"
)
# The answers of runs that make nothing, and the last word of a run that makes everything.
_ANSWER = re.compile(
    r"Nothing to be done|Unlocked|Deleting|Touching|Report created|Congratulations|archived |page to open"
)
_CELLS = 20


def _tail(log: str) -> list[str]:
    """The last lines of a log that are not empty, from the end."""
    try:
        with Path(log).open("rb") as stream:
            stream.seek(max(os.fstat(stream.fileno()).st_size - 20000, 0))
            lines = stream.read().decode("utf-8", errors="replace").splitlines()
    except OSError:
        return []
    return [line.strip() for line in reversed(lines) if line.strip()]


def error_sentence(log: str, executor: str | None = None) -> str:
    """Why a stage failed: from its log, or else what its executor says, a cluster's queue for one."""
    lines = _tail(log)
    if found := next((line for line in lines if _ERROR.search(line)), None):
        return found
    if executor:
        # What is set in is for the log of the run: the whole call of `sbatch`.
        return " ".join(takewhile(lambda line: not line.startswith(" "), executor.splitlines()))
    return f"no error message; its last line: {lines[0]}" if lines else "it left no message"


def _name(job: Any) -> str:
    return str(job.rule_msg or job.rule_name)


def _files(made: list[str]) -> str:
    return made[0] if len(made) == 1 else f"{made[0]} and {len(made) - 1} more"


def _doing(job: Any) -> str:
    """A stage that is going on, how much of it is done where its log says so, and since when."""
    found = _SHARE.search(next(iter(_tail(job.log[0])), "")) if job.log else None
    share = f" {100 * int(found[1]) // int(found[2])} %" if found else ""
    return f"{_name(job)}{share} ({time() - job.created:.0f} s)"


class LogHandler(LogHandlerBase):
    """The terminal of a run; where it is one, a bar stands below the lines."""

    writes_to_stream = True
    writes_to_file = False
    has_filter = False
    has_formatter = False
    needs_rulegraph = False

    def __post_init__(self) -> None:
        self.plain = bool(self.common_settings.dryrun or self.common_settings.verbose)
        self.stream = sys.stdout if self.common_settings.dryrun else sys.stderr
        self.bar = self.stream.isatty() and not self.plain
        self.begin, self.done, self.total = time(), 0, 0
        self.running: dict[int, Any] = {}
        self.ended = Event()
        python, folder = Path(sys.executable), Path.cwd()
        program = python.relative_to(folder) if python.is_relative_to(folder) else python
        self.command = [str(program), "-m", "snakemake", *sys.argv[1:]]
        if self.bar:
            Thread(target=self._draw, daemon=True).start()

    def emit(self, record: Any) -> None:
        try:
            text = self.format(record) if self.plain else self._text(record)
            if text and text != "None":
                self._write(f"{text}\n")
        except Exception:  # noqa: BLE001 - as logging does: what cannot be said does not end the run
            self.handleError(record)

    def close(self) -> None:
        self.ended.set()
        self._write("")
        super().close()

    def _text(self, record: Any) -> str | None:
        """What to say of an event; None where it is for the log only."""
        event = getattr(record, "event", None)
        if event == LogEvent.RUN_INFO:
            begins, self.total = not self.total, record.stats["total"]
            return f"Stages to make: {self.total}; each prints a line when it ends" if begins else None
        elif event == LogEvent.PROGRESS:
            self.total = record.total
        elif event == LogEvent.JOB_INFO:
            self.running[record.jobid] = record
        elif event == LogEvent.JOB_FINISHED:
            return self._finished(record)
        elif event == LogEvent.JOB_ERROR:
            return self._failed(record)
        elif event in (None, LogEvent.ERROR):
            text = self.format(record)
            told = _TOLD.search(text) if record.levelno >= WARNING else not _ANSWER.search(text)
            return None if told else text
        return None

    def _finished(self, record: Any) -> str | None:
        self.done += 1
        job = self.running.pop(record.job_id, None)
        if job is None:
            return None  # `--quiet rules`
        width = len(str(self.total))
        begin, made = (job.created, _files(job.output)) if job.output else (self.begin, "all is made")
        return f"[{self.done:{width}}/{self.total}] {record.created - begin:7.1f} s  {_name(job)}: {made}"

    def _failed(self, record: Any) -> str | None:
        """Stage, sentence, log, and the command that makes this stage again; None where it was told."""
        job = self.running.pop(record.jobid, None)
        if job is None:
            return None
        # Where a cluster's job got nowhere, its own log follows that of the stage.
        log = next((log for log in record.log if _tail(log)), "".join(record.log[:1]))
        return (
            f"failed after {record.created - job.created:.1f} s: {_name(job)}\n"
            f"  {error_sentence(log, record.rule_msg)}\n  log: {log}\n"
            f"  again: {shlex.join(self._for_target(*job.output[:1] or [job.rule_name]))}"
        )

    def _for_target(self, target: str) -> list[str]:
        """The command of this run, which makes the target as well."""
        if target in self.command:
            return self.command
        return [*self.command, *(() if "--" in self.command else ("--",)), target]

    def _write(self, text: str) -> None:
        """Write in the place of the bar."""
        self.acquire()
        try:
            self.stream.write(f"\r\x1b[K{text}" if self.bar else text)
            self.stream.flush()
        finally:
            self.release()

    def _draw(self) -> None:
        """The share of stages that are done and what is being made, anew each second."""
        while not self.ended.wait(1.0):
            filled = _CELLS * self.done // max(self.total, 1)
            bar = f"{'█' * filled}{'░' * (_CELLS - filled)} {self.done}/{self.total}"
            text = ", ".join([bar, *map(_doing, list(self.running.values()))])
            self._write(text[: shutil.get_terminal_size().columns - 1])
