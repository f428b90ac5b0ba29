"""Fetch one EuRoC sequence from the first source of a table that gives it.

The dataset belongs to the Autonomous Systems Lab, ETH Zurich: read the terms of the host.
"""

import argparse
from pathlib import Path

from vigauge.cli.command import LOG
from vigauge.errors import DataError
from vigauge.files import write_text
from vigauge.recordings.asl.sequence import read_sequence
from vigauge_paper.fetch.download import Patience
from vigauge_paper.fetch.sequence import RECORD, fetch_sequence
from vigauge_paper.fetch.sources import read_sources
from vigauge_paper.run.artefacts import FILE
from vigauge_paper.run.stage import parser, run


def work(options: argparse.Namespace) -> None:
    folder = options.output / options.sequence
    if (folder / "mav0").is_dir():
        read_sequence(folder)
        LOG.info("%s exists; delete it to fetch it again", folder)
    else:
        patience = Patience(options.attempts, options.first_wait)
        fetched = fetch_sequence(
            options.sequence, read_sources(options.sources), options.sources, options.output, patience
        )
        known = "as in the table" if fetched.sha256_expected else "not in the table"
        LOG.info("%s: %d files; SHA-256 of its zip is %s, %s", folder, fetched.files, fetched.sha256, known)
    if options.record:
        note = folder / RECORD
        if not note.is_file():
            raise DataError(note, "must exist: the sequence beside it was not fetched by this command")
        write_text(options.record, note.read_text("utf-8"))
    LOG.info("use it with EUROC_ROOT=%s", options.output)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--sequence", required=True, help="name of the sequence in the table")
    arguments.add_argument("--sources", **FILE, help="table of addresses")
    arguments.add_argument("--output", **FILE, help="folder in which <sequence>/mav0 is made")
    arguments.add_argument("--record", type=Path, help="output: where the sequence came from, JSON")
    default = Patience()
    arguments.add_argument("--attempts", type=int, default=default.attempts, help="attempts in a row")
    arguments.add_argument(
        "--first-wait", type=float, default=default.first_wait_s, help="wait after a failure, s; it doubles"
    )
    run(work, arguments)


if __name__ == "__main__":
    main()
