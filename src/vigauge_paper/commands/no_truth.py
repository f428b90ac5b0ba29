"""Table III with nothing of a ground truth in the estimate: biases in the state, begun by alignment."""

import argparse

from vigauge.errors import DataError
from vigauge.files import write_rows, write_text
from vigauge_paper.ids import STAND_IN
from vigauge_paper.no_truth import no_truth_rows, no_truth_sentence
from vigauge_paper.run.artefacts import STEM, add_section, named_file
from vigauge_paper.run.stage import json_argument, parser, run
from vigauge_paper.tables import markdown

_ABOUT = """# The sequences without any ground truth

In Table III the biases are those of a ground truth. Here nothing is: alignment finds where biases, gravity
and velocities start, and the biases are part of the state. The truth serves to measure errors only.
"""


def work(options: argparse.Namespace) -> None:
    rows = no_truth_rows(options.forms, dict(options.solutions), dict(options.distances), options.source)
    if not rows:
        raise DataError("no_truth", "must name at least one form of a sequence that is used", value=0)
    write_rows(f"{options.output}.csv", rows)
    head = _ABOUT + (f"\n{STAND_IN}." if options.source != "euroc" else "")
    margin = options.criteria["accuracy_margin"]
    text = markdown(rows, no_truth_sentence(rows, margin), head)
    write_text(f"{options.output}.md", text)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument(
        "--forms", type=json_argument, required=True, help="names of each sequence's forms, itself first"
    )
    for name in ("solutions", "distances"):
        about = f"NAME=FILE of the {name} of all forms (CSV)"
        arguments.add_argument(f"--{name}", type=named_file, nargs="*", default=[], help=about)
    add_section(arguments, "--criteria", "claims")
    arguments.add_argument("--source", choices=("euroc", "rendered"), required=True)
    arguments.add_argument("--output", **STEM, help="CSV; Markdown goes beside it")
    run(work, arguments)


if __name__ == "__main__":
    main()
