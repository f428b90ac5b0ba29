"""Say whether the tables and figures match the expected values of the repository.

Exit status 0 where all do, 1 where some differ, 2 where a file or a column is missing or another.
"""

import argparse
import sys
from dataclasses import asdict
from itertools import groupby
from pathlib import Path

from vigauge.files import write_rows
from vigauge_paper.comparison.expected import Match, matches, read_expected, renewed
from vigauge_paper.comparison.found import found_values
from vigauge_paper.run.stage import parser, run


def _line(artefact: str, source: str, found: list[Match]) -> str:
    """One artefact: its numbers, the one that is furthest off, and the verdict."""
    worst = max(found, key=lambda match: match.share)
    off = sum(not match.ok for match in found)
    text = f"{artefact:7} {source:10} {len(found):3d} compared, {f'{off} differ' if off else 'ok'}"
    if worst.share == 0.0:
        return f"{text}; all the same"
    wanted = worst.expected
    row = f"{wanted.row} {wanted.quantity}".strip()
    allowed = f"{wanted.kind} {worst.deviation:.2g} of {wanted.tolerance:g}"
    return f"{text}; worst {row}: {_shown(worst.found)}, expected {_shown(wanted.value)} ({allowed})"


def _shown(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.7g}"


def work(options: argparse.Namespace) -> None:
    found = found_values(options.artefacts)
    if options.write:
        expected = read_expected(options.expected) if options.expected.exists() else []
        write_rows(options.expected, [asdict(value) for value in renewed(expected, found)])
        print(f"{options.expected}: {len(found)} values from {options.artefacts}")
        return
    compared = matches(read_expected(options.expected), found)
    for (artefact, source), group in groupby(compared, key=lambda match: match.expected.key[:2]):
        print(_line(artefact, source, list(group)))
    differ = sum(not match.ok for match in compared)
    print(f"{len(compared)} values compared, {differ} differ: {options.artefacts}, {options.expected}")
    if differ:
        sys.exit(1)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--artefacts", type=Path, default=Path("paper_figures"), help="folder to check")
    arguments.add_argument("--expected", type=Path, default=Path("data/expected.csv"))
    arguments.add_argument(
        "--write", action="store_true", help="take what stands there as the expected values of its source"
    )
    run(work, arguments)


if __name__ == "__main__":
    main()
