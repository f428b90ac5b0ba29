"""Say what the measurements of an estimate determine, what they do not, and why.

Of an information matrix, also what looks wrong with it, a line each.
"""

from __future__ import annotations

import argparse
import sys

from vigauge.adapters.information import Information
from vigauge.cli.command import EXIT_DEFECT, parser, run
from vigauge.cli.estimate_file import EXIT_WITHHELD, add_arguments, read_named, state_of
from vigauge.errors import SolverError
from vigauge.gauge.layout import null_space
from vigauge.model.problem import Problem
from vigauge.observability.diagnosis import diagnose, diagnose_hessian


def work(options: argparse.Namespace) -> None:
    given = read_named(options)
    try:
        sentence, withheld = _finding(given, at_start=options.at_start)
    except SolverError as error:
        sentence, withheld = str(error), True
    print(sentence)
    if withheld:
        sys.exit(EXIT_WITHHELD)


def _finding(given: Problem | Information, *, at_start: bool) -> tuple[str, bool]:
    if not isinstance(given, Information):
        found = diagnose(given, state_of(given, at_start=at_start))
        return found.sentence, bool(found.withheld)
    U = null_space(**given.estimate)
    blocks = {kind: columns[columns >= 0] for kind, columns in given.layout.blocks.items()}
    if given.layout.n_points:
        blocks["points"] = given.layout.points.ravel()
    # In the plane a shift along z moves nothing.
    found = diagnose_hessian(given.H, U[:, U.any(axis=0)], blocks)
    return "\n".join([found.sentence, *map(str, given.audit())]), found.degenerate


def main() -> None:
    arguments = parser(__doc__)
    add_arguments(arguments)
    run(work, arguments, defect_status=EXIT_DEFECT)


if __name__ == "__main__":
    main()
