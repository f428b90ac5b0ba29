"""Set every published number beside ours, with the range of ours and the ratio."""

import argparse
import math
from pathlib import Path

from vigauge.cli.command import LOG
from vigauge.files import write_rows, write_text
from vigauge.solver.levenberg_marquardt import Options
from vigauge_paper.comparison.number import counts, machine, score
from vigauge_paper.comparison.numbers import Results, numbers
from vigauge_paper.comparison.variants import FACTOR, MOVED, OFF, VARIANTS, explained_by_chance, variants
from vigauge_paper.ids import STAND_IN, Row
from vigauge_paper.run.artefacts import FILE, NAMED, add_published_names, add_reading, add_solver
from vigauge_paper.run.provenance import made_with
from vigauge_paper.run.stage import parser, run, settings_from
from vigauge_paper.tables import markdown


def _head(table: list[Row], scores: tuple[float, float], source: str) -> str:
    note = (
        "The yardstick is the range of our own trials, from the smallest to the largest; where there is one "
        f"problem only, there is none. Table II under fixation: mean |log ratio| {scores[0]:.3f}, largest "
        f"{scores[1]:.3f}; its published numbers are means over 50 trials, and a single trial varies more."
    )
    if source != "euroc":
        note += f" Table III and Figures 1, 10 and 11 are left out: {STAND_IN}."
    return markdown(table, note)


def _machine(row: Row, count: int) -> str:
    ratio, ours = float(str(row["ratio"])), float(str(row["ours"]))
    return (
        f"All {count} published median times: ours take {ratio:.3g} of the paper's, a factor of machine and "
        f"solver; single times lie around it by a factor of {float(str(row['high'])) / ours:.2f}.\n"
    )


def _shown(value: object) -> object:
    """A dash where there is no range."""
    return "-" if value is None or (isinstance(value, float) and math.isnan(value)) else value


def _chance(seed: int) -> str:
    return (
        f"Nobody chooses among these: of random numbers that are off by more than a factor of {FACTOR:g}, up "
        f"to {OFF:g}, {100 * explained_by_chance(seed):.0f} % are brought inside it by at least one of "
        f"{VARIANTS} variants that move each number at random by a factor of up to {MOVED:g}. Table II is "
        "the only table that the sweep makes anew. The hidden bias has as many parameters as it explains."
    )


def _sweep(options: argparse.Namespace) -> Path | None:
    """The summary of the sensitivity sweep, where it is of the same configuration as the results."""
    sweep = options.sensitivity
    if sweep and made_with(options.stamps, options.sensitivity_stamp, "sensitivity sweep"):
        return Path(sweep)
    return None


def work(options: argparse.Namespace) -> None:
    found, times = numbers(
        Results(
            dict(options.solutions),
            dict(options.timings),
            dict(options.covariances),
            options.sweep,
            options.sweep_timing,
            options.sweep_trace,
            options.prior_reading,
            options.problems,
            settings_from(Options, options.solver, "solver"),
            options.published,
            dict(options.published_names),
        )
    )
    rows, machines = [number.row() for number in found], machine(times)
    write_rows(options.output, [*rows, machines])
    changes = variants(options.hypothesis, _sweep(options))
    parts = [
        "# Published numbers and ours",
        _head(counts(found), score(found), options.source),
        _machine(machines, len(times)),
        "## What single changes do to Table II",
        markdown(changes, _chance(options.seed)),
        "## All numbers",
        markdown([{key: _shown(value) for key, value in row.items()} for row in rows]),
    ]
    write_text(options.output.with_suffix(".md"), "\n".join(parts))
    LOG.info("%d numbers; Table II: mean |log ratio| %.3f, largest %.3f", len(rows), *score(found))


def main() -> None:
    arguments = parser(__doc__)
    for name, text in (
        ("solutions", "NAME=solutions.csv of all experiments"),
        ("timings", "NAME=timing.csv of all experiments"),
        ("covariances", "NAME=FILE of covariances of all experiments"),
    ):
        arguments.add_argument(f"--{name}", **NAMED, help=text)
    for name, text in (
        ("sweep", "table of the prior sweep"),
        ("sweep-timing", "its times"),
        ("sweep-trace", "its trace"),
        ("problems", "problems of the sweep's configuration, for Fig. 9"),
        ("hypothesis", "table of the experiment 'bias_hypothesis'"),
        ("published", "folder of the published numbers"),
    ):
        arguments.add_argument(f"--{name}", **FILE, help=text)
    add_reading(arguments)
    add_solver(arguments)
    arguments.add_argument("--source", choices=("euroc", "rendered", "other"), required=True)
    add_published_names(arguments)
    arguments.add_argument("--seed", type=int, required=True, help="of the random tables")
    arguments.add_argument(
        "--sensitivity", type=Path, help="summary of the sensitivity sweep, if there is one"
    )
    arguments.add_argument("--sensitivity-stamp", type=Path, help="stamp of that summary")
    arguments.add_argument("--output", **FILE, help="CSV; the page goes beside it")
    run(work, arguments)


if __name__ == "__main__":
    main()
