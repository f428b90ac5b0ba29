"""Check a recording in ASL layout: what it is, and what is wrong with it.

Exit status: 0 nothing wrong found, 1 warnings, 2 errors: unusable as it is.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from vigauge.cli.command import EXIT_DEFECT, LOG, parser, run
from vigauge.files import write_json
from vigauge.recordings.checks.sequence import Window, check_sequence


def work(options: argparse.Namespace) -> None:
    window = Window(options.origin_ns, *options.window)
    found = check_sequence(
        options.folder, options.truth, window, options.camera_time_offset_ns, sort=options.sort
    )
    report = found.to_mapping()
    if options.json:
        print(json.dumps(report, indent=2, sort_keys=True, allow_nan=False))
    elif not options.output:
        print("\n".join(found.lines()))
    if options.output:
        # The log must tell why a rule stopped: its output is not kept then.
        LOG.info("%s", "\n".join(found.lines()))
    status = found.exit_status
    accepted = 2 if options.accept_errors else int(options.accept_warnings)
    if options.output and status <= max(accepted, 1):
        write_json(options.output, report)
    if status > accepted:
        sys.exit(status)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("folder", type=Path, help="folder with mav0/ in it")
    arguments.add_argument(
        "--truth", nargs="*", metavar="NAME", help="ground-truth folders below mav0 to check; default: all"
    )
    arguments.add_argument(
        "--window",
        type=float,
        nargs=2,
        default=(0.0, float("inf")),
        metavar=("START", "END"),
        help="part to check, in seconds; default: all",
    )
    arguments.add_argument(
        "--origin-ns",
        type=int,
        default=0,
        help="stamp at which the window's time is zero; default: the first frame",
    )
    arguments.add_argument(
        "--camera-time-offset-ns", type=int, default=0, help="offset to add to the stamps of frames"
    )
    arguments.add_argument(
        "--sort", action="store_true", help="sort rows that are out of order, and warn of them"
    )
    arguments.add_argument("--json", action="store_true", help="print JSON instead of text")
    arguments.add_argument(
        "--output", type=Path, help="also write the JSON to this file, unless the recording is unusable"
    )
    arguments.add_argument(
        "--accept-warnings", action="store_true", help="end with status 0 if there are only warnings"
    )
    arguments.add_argument(
        "--accept-errors", action="store_true", help="end with status 0 and write the file, whatever is found"
    )
    run(work, arguments, defect_status=EXIT_DEFECT)


if __name__ == "__main__":
    main()
