"""Long fuzzing run: ``make fuzz``, or ``PYTHONPATH=tests python -m fuzz.run --inputs 100000 --seconds 70``.

An input that crashes a reader is kept; after a crash of the interpreter the last one is ``READER.current``.
"""

import argparse
import logging
import sys
import time
import warnings
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from tqdm import tqdm

from vigauge.files import write_rows

from .reader import Reader, outcome
from .readers import all_readers

# Of processor time: a loaded machine is no hang.
LONGEST_S = 2.0


def fuzz_named(name: str, inputs: int, seconds: float, crashes: Path) -> dict[str, object]:
    """As :func:`fuzz`, in a process of its own."""
    warnings.simplefilter("error", RuntimeWarning)
    logging.disable(logging.ERROR)
    with all_readers() as readers:
        return fuzz(readers[name], inputs, seconds, crashes)


def fuzz(reader: Reader, inputs: int, seconds: float, crashes: Path) -> dict[str, object]:
    """The row of one reader: counts by outcome, and the longest time. It ends after ``seconds`` of work."""
    outcomes: Counter[str] = Counter()
    longest = 0.0
    file = reader.name.replace(" ", "_")
    end = time.process_time() + seconds
    for number in range(inputs):
        if time.process_time() > end:
            break
        data = reader.input(number)
        (crashes / f"{file}.current").write_bytes(data)
        begin = time.process_time()
        try:
            outcomes[outcome(reader, data)] += 1
        except Exception as error:  # noqa: BLE001 - any escape is what is looked for
            outcomes["crash"] += 1
            kept = crashes / f"{file}.{number}"
            kept.write_bytes(data)
            print(f"{type(error).__name__}: {error}; kept as {kept}", file=sys.stderr)
        longest = max(longest, time.process_time() - begin)
    accepted, crashed = outcomes.pop("accepted", 0), outcomes.pop("crash", 0)
    return {
        "reader": reader.name,
        "inputs": accepted + crashed + outcomes.total(),
        "accepted": accepted,
        "crashes": crashed,
        "refused": outcomes.total(),
        "errors": "; ".join(f"{error} {count}" for error, count in sorted(outcomes.items())),
        "longest_s": f"{longest:.3f}",
    }


def main() -> None:
    arguments = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    arguments.add_argument("--inputs", type=int, default=100_000, help="inputs per reader")
    arguments.add_argument(
        "--seconds", type=float, default=70.0, help="processor time after which a reader gets no more inputs"
    )
    arguments.add_argument("--jobs", type=int, default=2, help="readers at a time")
    arguments.add_argument("--record", type=Path, help="output: CSV file with a row per reader")
    arguments.add_argument("--crashes", type=Path, default=Path("data/fuzz"), help="folder for bad inputs")
    options = arguments.parse_args()
    options.crashes.mkdir(parents=True, exist_ok=True)
    with all_readers() as readers:
        names = list(readers)
    run = partial(fuzz_named, inputs=options.inputs, seconds=options.seconds, crashes=options.crashes)
    with ProcessPoolExecutor(options.jobs) as pool:
        rows = list(tqdm(pool.map(run, names), total=len(names), disable=None))
    if options.record:
        write_rows(options.record, rows)
    bad = [row["reader"] for row in rows if row["crashes"] or float(str(row["longest_s"])) > LONGEST_S]
    if bad:
        raise SystemExit(f"crashed or took too long: {bad}")


if __name__ == "__main__":
    main()
