"""Fetch one EuRoC sequence from the first source of a table that gives it.

The dataset belongs to the Autonomous Systems Lab, ETH Zurich: read the terms of the place it comes from.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from tqdm import tqdm

from vigauge.cli.command import LOG
from vigauge.errors import DataError
from vigauge.files import write_text
from vigauge.recordings.asl.sequence import read_sequence
from vigauge_paper.fetch.http import Patience
from vigauge_paper.fetch.sequence import RECORD, fetch_sequence
from vigauge_paper.fetch.sources import read_sources
from vigauge_paper.run.stage import parser, run


@contextmanager
def bar(label: str, have: int, total: int) -> Iterator[Callable[[int], object]]:
    """A progress bar in bytes, where there is a terminal."""
    with tqdm(desc=label, initial=have, total=total, unit="B", unit_scale=True, disable=None) as shown:
        yield shown.update


def work(options: argparse.Namespace) -> None:
    folder = options.output / options.sequence
    if (folder / "mav0").is_dir():
        read_sequence(folder)
        LOG.info("%s is there already; delete it to have it fetched anew", folder)
    else:
        patience = Patience(options.attempts, options.first_wait, options.longest_wait, options.timeout)
        fetched = fetch_sequence(
            options.sequence, read_sources(options.sources), options.sources, options.output, patience, bar
        )
        known = "as expected" if fetched.sha256_expected else "which nothing could be compared with"
        LOG.info("%s: %d files; SHA-256 of its zip %s, %s", folder, fetched.files, fetched.sha256, known)
    if options.record:
        note = folder / RECORD
        if not note.is_file():
            raise DataError(note, "must exist: the sequence beside it was not fetched by this command")
        write_text(options.record, note.read_text("utf-8"))
    LOG.info("use it with EUROC_ROOT=%s", options.output)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--sequence", required=True, help="name of the sequence in the table")
    arguments.add_argument("--sources", type=Path, required=True, help="table of addresses")
    arguments.add_argument(
        "--output", type=Path, required=True, help="folder in which <sequence>/mav0 is made"
    )
    arguments.add_argument("--record", type=Path, help="output: where the sequence came from, JSON")
    default = Patience()
    arguments.add_argument("--attempts", type=int, default=default.attempts, help="attempts a request")
    arguments.add_argument("--first-wait", type=float, default=default.first_wait_s, help="first wait, s")
    arguments.add_argument("--longest-wait", type=float, default=default.longest_wait_s, help="longest, s")
    arguments.add_argument("--timeout", type=float, default=default.timeout_s, help="silence of a host, s")
    run(work, arguments)


if __name__ == "__main__":
    main()
