"""Put the windows of all recordings into one table, and start beside optimum into another."""

import argparse

from vigauge.cli.command import LOG
from vigauge.errors import DataError
from vigauge.files import write_rows, write_text
from vigauge_paper.experiments.windows import COMPARED, DISTANCES, summarise, window_rows
from vigauge_paper.ids import STAND_IN
from vigauge_paper.run.artefacts import FILE
from vigauge_paper.run.stage import json_argument, parser, run
from vigauge_paper.tables import markdown

_SHOWN = (
    "window",
    "keyframes",
    "landmarks",
    "noise",
    "gauge",
    "iterations",
    *(name for error in COMPARED for name in (f"start_{error}", error)),
    *DISTANCES,
)


def _cell(text: str) -> object:
    try:
        return float(text) if "." in text or "e" in text else text
    except ValueError:
        return text


def work(options: argparse.Namespace) -> None:
    rows = [row for name, about in options.windows.items() for row in window_rows(options.data, name, about)]
    if not rows:
        raise DataError("windows", "there must be at least one window", value=0)
    write_rows(options.output, [{**row, "source": options.source} for row in rows])
    summary = summarise(rows)
    if summary:
        write_rows(options.summary, summary)
    else:
        write_text(options.summary, "noise,error\n")
    solved = [{name: _cell(row[name]) for name in _SHOWN} for row in rows if row["gauge"]]
    refused = [{name: row[name] for name in ("window", "stopped_at", "why")} for row in rows if row["why"]]
    text = ["# Windows of the recordings", ""]
    if options.source != "euroc":
        text += [f"{STAND_IN}.", ""]
    text += [markdown(solved)] if solved else []
    if summary:
        about = (
            "Is the optimum (free gauge) nearer to the truth than the start? Windows in pairs; "
            "a ratio below 1 says yes. Windows of one recording overlap, which makes p smaller than it is."
        )
        text += ["## Start and optimum", "", markdown(summary, about)]
    text += ["## Not used", "", markdown(refused)] if refused else []
    write_text(options.output.with_suffix(".md"), "\n".join(text))
    LOG.info("%d rows, %d of them of windows that stopped", len(rows), len(refused))


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument(
        "--windows", type=json_argument, required=True, help="start_s, end_s and truth of each, by name"
    )
    arguments.add_argument("--data", **FILE, help="folder of their checks and results")
    arguments.add_argument("--source", choices=("euroc", "rendered"), required=True)
    arguments.add_argument("--output", **FILE, help="output: CSV; Markdown goes beside it")
    arguments.add_argument("--summary", **FILE, help="output: start against optimum")
    run(work, arguments)


if __name__ == "__main__":
    main()
