"""Coverage-guided fuzzing of one reader with atheris, where it is installed (``pip install atheris``).

``PYTHONPATH=tests python -m fuzz.guided --reader sensor.yaml --inputs 100000``. The valid files
start the corpus; inputs that reach new branches of the package join it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["vigauge", "yaml"]):
    from .readers import all_readers, outcome
    from .run import peak_mib, record


def main() -> None:
    arguments = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    arguments.add_argument("--reader", required=True)
    arguments.add_argument("--inputs", type=int, default=100_000)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--record", type=Path, help="CSV file that gets the row of this reader")
    options = arguments.parse_args()
    outcomes: Counter[str] = Counter()
    longest = 0.0
    with all_readers() as readers, tempfile.TemporaryDirectory() as corpus:
        reader = readers[options.reader]
        for k, data in enumerate(reader.seeds):
            (Path(corpus) / str(k)).write_bytes(data)
            outcome(reader, data)
        start = peak_mib()

        def one(data: bytes) -> None:
            nonlocal longest
            begin = time.process_time()
            outcomes[outcome(reader, data)] += 1
            longest = max(longest, time.process_time() - begin)
            if options.record and outcomes.total() == options.inputs:  # the process ends inside Fuzz
                accepted = outcomes.pop("accepted", 0)
                row: dict[str, object] = {
                    "reader": options.reader,
                    "driver": "atheris",
                    "first_input": options.seed,
                    "inputs": options.inputs,
                    "accepted": accepted,
                    "crashes": 0,
                    "refused": outcomes.total(),
                    "errors": "; ".join(f"{error} {count}" for error, count in sorted(outcomes.items())),
                    "longest_s": f"{longest:.3f}",
                    "peak_memory_growth_mib": f"{peak_mib() - start:.0f}",
                }
                record(options.record, row)

        flags = [f"-atheris_runs={options.inputs}", f"-seed={options.seed}", "-max_len=20000", "-timeout=20"]
        atheris.Setup([sys.argv[0], *flags, corpus], one)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
