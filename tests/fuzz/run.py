"""Long fuzzing run: ``make fuzz``, or ``PYTHONPATH=tests python -m fuzz.run --inputs 100000``.

Every reader runs in a process of its own, so that a crash of the interpreter is seen and
the memory it took can be told. The input that crashed is kept.
"""

from __future__ import annotations

import argparse
import csv
import json
import multiprocessing
import resource
import signal
import sys
import time
import warnings
from collections import Counter
from pathlib import Path
from types import FrameType
from typing import Any

from tqdm import tqdm

from vigauge.files import write_rows

from .readers import all_readers, outcome

# Of processor time: a loaded machine is no hang.
LONGEST_S = 2.0
HANG_S = 20
LARGEST_GROWTH_MIB = 300


class Hang(BaseException):
    """Not an Exception, so that no reader can take it for one of its own."""


def _alarm(number: int, frame: FrameType | None) -> None:
    raise Hang


def peak_mib() -> float:
    """Largest resident memory of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)


def fuzz(name: str, first: int, count: int, crashes: Path, progress: bool) -> dict[str, Any]:
    """Inputs ``first`` to ``first + count`` of one reader; counts by outcome, times and memory."""
    warnings.simplefilter("error", RuntimeWarning)
    signal.signal(signal.SIGALRM, _alarm)
    outcomes: Counter[str] = Counter()
    longest = 0.0
    with all_readers() as readers:
        reader = readers[name]
        for seed in reader.seeds:
            outcome(reader, seed)
        start_mib = peak_mib()
        current = crashes / f"{name.replace(' ', '_')}.current"
        for number in tqdm(range(first, first + count), desc=name, disable=None if progress else True):
            data = reader.input(number)
            current.write_bytes(data)
            begin = time.process_time()
            signal.alarm(HANG_S)
            try:
                outcomes[outcome(reader, data)] += 1
            except (Exception, Hang) as error:  # noqa: BLE001 - any escape is what is looked for
                outcomes["crash"] += 1
                kept = crashes / f"{name.replace(' ', '_')}.{number}"
                kept.write_bytes(data)
                print(
                    f"{name}, input {number}: {type(error).__name__}: {error}; kept as {kept}",
                    file=sys.stderr,
                )
            signal.alarm(0)
            longest = max(longest, time.process_time() - begin)
        current.unlink()
        memory = peak_mib() - start_mib
    return {"outcomes": dict(outcomes), "longest_s": longest, "peak_growth_mib": memory}


def _child(name: str, first: int, count: int, crashes: Path, out: Path) -> None:
    out.write_text(json.dumps(fuzz(name, first, count, crashes, progress=True)))


def row_of(name: str, first: int, count: int, crashes: Path) -> dict[str, object]:
    """Fuzz one reader in a process; a process that dies is a crash of its last input."""
    out = crashes / f"{name.replace(' ', '_')}.json"
    process = multiprocessing.get_context("spawn").Process(
        target=_child, args=(name, first, count, crashes, out)
    )
    process.start()
    process.join()
    if process.exitcode != 0:
        raise SystemExit(f"{name}: process ended with {process.exitcode}; input kept in {crashes}")
    result = json.loads(out.read_text())
    out.unlink()
    found = result["outcomes"]
    return {
        "reader": name,
        "driver": "mutation",
        "first_input": first,
        "inputs": sum(found.values()),
        "accepted": found.pop("accepted", 0),
        "crashes": found.pop("crash", 0),
        "refused": sum(found.values()),
        "errors": "; ".join(f"{error} {count}" for error, count in sorted(found.items())),
        "longest_s": f"{result['longest_s']:.3f}",
        "peak_memory_growth_mib": f"{result['peak_growth_mib']:.0f}",
    }


def record(path: Path, row: dict[str, object]) -> None:
    """Put a row into the record in the place of an earlier one of the same reader and driver."""
    rows: list[dict[str, object]] = []
    if path.exists():
        with path.open(encoding="utf-8", newline="") as stream:
            rows = [dict(old) for old in csv.DictReader(stream)]
    same = [k for k, old in enumerate(rows) if all(old[name] == row[name] for name in ("reader", "driver"))]
    rows[same[0] if same else len(rows) : (same[0] + 1 if same else None)] = [row]
    write_rows(path, rows)


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--inputs", type=int, default=100_000, help="inputs a reader")
    arguments.add_argument(
        "--first", type=int, default=0, help="number of the first input: others than before"
    )
    arguments.add_argument("--readers", nargs="*", help="names; all without")
    arguments.add_argument("--record", type=Path, help="CSV file that gets a row a reader")
    arguments.add_argument("--crashes", type=Path, default=Path("data/fuzz"), help="folder for bad inputs")
    options = arguments.parse_args()
    options.crashes.mkdir(parents=True, exist_ok=True)
    with all_readers() as readers:
        names = options.readers or list(readers)
    rows = []
    for name in names:
        rows.append(row_of(name, options.first, options.inputs, options.crashes))
        print(rows[-1])
        if options.record:
            record(options.record, rows[-1])
    bad = [
        row
        for row in rows
        if row["crashes"]
        or float(str(row["longest_s"])) > LONGEST_S
        or float(str(row["peak_memory_growth_mib"])) > LARGEST_GROWTH_MIB
    ]
    if bad:
        raise SystemExit(f"not as it must be: {[row['reader'] for row in bad]}")


if __name__ == "__main__":
    main()
