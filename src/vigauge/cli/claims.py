"""Judge the paper's claims from the result files."""

from __future__ import annotations

import argparse
from pathlib import Path

from vigauge.claims import Criteria, Evidence, ledger
from vigauge.cli.artefacts import named_file
from vigauge.cli.stage import LOG, json_argument, parser, run, settings_from
from vigauge.files import write_rows, write_text
from vigauge.tables import markdown


def work(options: argparse.Namespace) -> None:
    criteria = settings_from(Criteria, options.criteria, "claims")
    evidence = Evidence(
        solutions=dict(options.solutions),
        timings=dict(options.timings),
        covariances=dict(options.covariances),
        sweep=options.sweep,
        sequences=tuple(options.sequences),
        source=options.source,
        criteria=criteria,
    )
    rows = ledger(evidence)
    note = (
        f"Accuracy margin {100 * criteria.accuracy_margin:g} %, intervals at {100 * criteria.confidence:g} %."
    )
    write_rows(options.output, rows)
    write_text(options.output.with_suffix(".md"), markdown(rows, note))
    for row in rows:
        LOG.info("%-10s %s: %s", row["verdict"], row["claim"], row["measured"])


def main() -> None:
    arguments = parser(__doc__)
    for name in ("solutions", "timings", "covariances"):
        arguments.add_argument(
            f"--{name}", type=named_file, nargs="+", required=True, help="NAME=FILE of each experiment"
        )
    arguments.add_argument("--sweep", type=Path, required=True)
    arguments.add_argument(
        "--sequences", nargs="+", required=True, help="names among them that are image sequences"
    )
    arguments.add_argument("--source", choices=("euroc", "rendered"), required=True)
    arguments.add_argument("--criteria", type=json_argument, required=True, help="config section 'claims'")
    arguments.add_argument("--output", type=Path, required=True, help="claims.csv; claims.md goes beside it")
    run(work, arguments)


if __name__ == "__main__":
    main()
