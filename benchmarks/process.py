"""A solver's process: asked by lines, answered by lines of JSON, ended when it is late or greedy."""

from __future__ import annotations

import json
import os
import queue
import resource
import subprocess
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from vigauge.errors import VigaugeError

ROOT = Path(__file__).resolve().parent.parent


class DroppedOut(VigaugeError):
    """A solver that is out of the race; the message is the note of its rows."""


def pinned(threads: int) -> dict[str, str]:
    """Environment in which no library uses more threads."""
    names = ("OMP", "OPENBLAS", "MKL", "NUMBA", "VECLIB", "TBB", "BLIS")
    return dict(os.environ) | {f"{name}_NUM_THREADS": str(threads) for name in names}


def _restrict(threads: int, memory_gib: float) -> None:
    """In the child: as many cores as threads, where the system can pin, and an end to its memory."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-threads:])
    limit = int(memory_gib * 2**30)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))


class SolverProcess:
    """One solver with one problem loaded, on ``threads`` cores of its own."""

    def __init__(
        self,
        command: Sequence[str],
        threads: int,
        *,
        limit_s: float,
        memory_gib: float,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self.limit_s, self.memory_gib = limit_s, memory_gib
        self.errors = tempfile.TemporaryFile()  # noqa: SIM115, closed in __exit__
        self.process = subprocess.Popen(
            list(command),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self.errors,
            text=True,
            cwd=ROOT,  # where `python -m benchmarks.worker` finds itself
            env=pinned(threads) | dict(environment or {}),
            preexec_fn=lambda: _restrict(threads, memory_gib),
        )
        self.lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        threading.Thread(target=self._listen, daemon=True).start()
        self.first = self._answer(limit_s)

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.put(line)
        self.lines.put("")

    def ask(self, *words: object) -> dict[str, Any]:
        """One request; raises DroppedOut, with the reason, where no answer comes."""
        if self.process.stdin is None or self.process.poll() is not None:
            raise DroppedOut(self._reason())
        try:
            print(*words, file=self.process.stdin, flush=True)
        except BrokenPipeError as error:
            raise DroppedOut(self._reason()) from error
        return self._answer(self.limit_s)

    def _answer(self, limit_s: float) -> dict[str, Any]:
        end = time.monotonic() + limit_s
        while True:
            try:
                line = self.lines.get(timeout=max(end - time.monotonic(), 0.0))
            except queue.Empty:
                self.close()
                raise DroppedOut(f"over {limit_s:g} s") from None
            if not line:
                raise DroppedOut(self._reason())
            if line.startswith("{"):  # a library may print something of its own
                return json.loads(line)

    def _reason(self) -> str:
        """Why the process ended: the last line it wrote on stderr."""
        code = self.process.wait()
        self.errors.seek(0)
        lines = self.errors.read().decode(errors="replace").strip().splitlines()
        last = lines[-1].strip() if lines else "no message"
        if "MemoryError" in last or "bad_alloc" in last or code == -9:
            return f"over {self.memory_gib:g} GiB"
        return f"failed: {last[:160]}"

    def close(self) -> None:
        """End the process, whatever it does."""
        self.process.kill()
        self.process.wait()
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None and not stream.closed:
                with suppress(BrokenPipeError):  # a request that it will not read any more
                    stream.close()

    def __enter__(self) -> SolverProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
        self.errors.close()
