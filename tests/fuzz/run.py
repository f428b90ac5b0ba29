"""Long fuzzing run: ``make fuzz``, or ``PYTHONPATH=tests python -m fuzz.run --inputs 100000``.

An input that crashes a reader is kept; after a crash of the interpreter the last one is ``current``.
"""

import argparse
import sys
import time
import warnings
from collections import Counter
from pathlib import Path

from tqdm import trange

from vigauge.files import write_rows

from .readers import Reader, all_readers, outcome

# Of processor time: a loaded machine is no hang.
LONGEST_S = 2.0


def fuzz(reader: Reader, inputs: int, crashes: Path) -> dict[str, object]:
    """The row of one reader: counts by outcome, and the longest time."""
    outcomes: Counter[str] = Counter()
    longest = 0.0
    for number in trange(inputs, desc=reader.name, disable=None):
        data = reader.input(number)
        (crashes / "current").write_bytes(data)
        begin = time.process_time()
        try:
            outcomes[outcome(reader, data)] += 1
        except Exception as error:  # noqa: BLE001 - any escape is what is looked for
            outcomes["crash"] += 1
            kept = crashes / f"{reader.name.replace(' ', '_')}.{number}"
            kept.write_bytes(data)
            print(f"{type(error).__name__}: {error}; kept as {kept}", file=sys.stderr)
        longest = max(longest, time.process_time() - begin)
    accepted, crashed = outcomes.pop("accepted", 0), outcomes.pop("crash", 0)
    return {
        "reader": reader.name,
        "inputs": inputs,
        "accepted": accepted,
        "crashes": crashed,
        "refused": outcomes.total(),
        "errors": "; ".join(f"{error} {count}" for error, count in sorted(outcomes.items())),
        "longest_s": f"{longest:.3f}",
    }


def main() -> None:
    arguments = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    arguments.add_argument("--inputs", type=int, default=100_000, help="inputs per reader")
    arguments.add_argument("--record", type=Path, help="output: CSV file with a row per reader")
    arguments.add_argument("--crashes", type=Path, default=Path("data/fuzz"), help="folder for bad inputs")
    options = arguments.parse_args()
    options.crashes.mkdir(parents=True, exist_ok=True)
    warnings.simplefilter("error", RuntimeWarning)
    with all_readers() as readers:
        rows = [fuzz(reader, options.inputs, options.crashes) for reader in readers.values()]
    if options.record:
        write_rows(options.record, rows)
    bad = [row["reader"] for row in rows if row["crashes"] or float(str(row["longest_s"])) > LONGEST_S]
    if bad:
        raise SystemExit(f"crashed or took too long: {bad}")


if __name__ == "__main__":
    main()
