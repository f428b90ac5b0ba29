"""Write Table I, II or III as CSV, Markdown and LaTeX."""

import argparse
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from vigauge_paper.ids import STAND_IN
from vigauge_paper.run.artefacts import STEM, add_published, add_published_names, named_file
from vigauge_paper.run.provenance import made_with
from vigauge_paper.run.stage import parser, run
from vigauge_paper.spread import spread_sentence
from vigauge_paper.tables import (
    degenerate,
    left_out,
    starts,
    table1,
    table2,
    table3,
    trial_count,
    wide_errors,
    worse_than_start,
    write_table,
)

_TRUTHS = {
    "state_groundtruth_derived0": "published poses as truth, velocities re-derived with the accelerometer",
    "state_groundtruth_openvins0": "truth re-estimated from Vicon and inertial data, not the published one",
}
_COLUMNS = "RMSE of position p, rotation phi and velocity v, in m, deg, m/s"
_GAUGES = (
    "After first-pose alignment, weighted by the published noise. fix: the first position and yaw are "
    "held; free: nothing is; the .csv has the prior of the configured weight as well."
)
_BOLD = "Bold: the smaller of fixation and free."


def work(options: argparse.Namespace) -> None:
    solutions = dict(options.solutions)
    if options.table == 1:
        note = "Ranks are measured on the Jacobi-scaled Hessian of one simulated problem."
        write_table(table1(options.covariance), options.output, note=note)
        return
    published = options.published / f"table{options.table}.csv" if options.published else None
    beside = " In brackets: the paper." if published else ""
    if options.table == 2:
        rows = table2(solutions)
        what = f"{_COLUMNS}; means over {trial_count(solutions)} trials."
        note = f"{what} {_BOLD}{beside}{left_out(solutions)}{degenerate(solutions)}"
        write_table(rows, options.output, wide_errors(rows, published), note)
        return
    rows = table3(solutions, options.source)
    names = dict(options.published_names)
    what = _COLUMNS if options.source == "euroc" else f"{_COLUMNS}; {STAND_IN}"
    counted = left_out(solutions) + degenerate(solutions)
    note = f"{what}. {_GAUGES} {_BOLD}{beside if names else ''}{counted}"
    note += f" {starts(solutions)} {_truths(options.reports)}"
    if options.spread and made_with(options.stamps, options.spread_stamp, "spread"):
        note += f" {spread_sentence(pd.read_csv(options.spread))}"
    data = f"{_recordings(options.reports)} {_too_small(pd.read_csv(options.errors))}".strip()
    head = worse_than_start(solutions) + data
    write_table(rows, options.output, wide_errors(rows, published if names else None, names), note, head)


def _recordings(reports: list[tuple[str, Path]]) -> str:
    """What the data are, from the front-end's reports."""
    parts = []
    for name, file in reports:
        report = json.loads(file.read_text(encoding="utf-8"))
        gaps = (
            f"{report['frame_gap_median_s']:.2g} s apart (median; at most {report['frame_gap_max_s']:.2g} s)"
        )
        frames = f"{report['frames']} of the {report['frames_recorded']} frames at hand, {gaps}"
        about = _TRUTHS.get(report["truth"], f"truth {report['truth']}")
        parts.append(f"{name}: {frames}; {about}")
    return f"The data. {'. '.join(parts)}."


def _too_small(errors: pd.DataFrame) -> str:
    """How errors compare with the sigmas that the covariance predicts; empty where it was withheld."""
    if "sigma" not in errors:
        return ""
    squared = errors.assign(squared=(errors["error"] / errors["sigma"]) ** 2)
    ratios = np.sqrt(squared.groupby(["quantity", "sequence"], sort=False)["squared"].mean())
    words = "; ".join(
        f"{quantity} {', '.join(f'{ratio:.2g}' for ratio in part)}"
        for quantity, part in ratios.groupby("quantity", sort=False)
    )
    names = ", ".join(errors["sequence"].unique())
    small = "are several times too small; they " if ratios.min() > 2.0 else ""
    return (
        f"At the published noise the predicted sigmas {small}have an rms of error over sigma, keyframe by "
        f"keyframe in the fixed gauge ({names}): {words} (fig_errors)."
    )


def _truths(reports: list[tuple[str, Path]]) -> str:
    """A sentence on what each sequence was evaluated against, from the front-end's reports."""
    parts = []
    for name, file in reports:
        report = json.loads(file.read_text(encoding="utf-8"))
        truth = f"{report['truth']}{_steps(report['truth_steps'])}"
        parts.append(f"{name}: {report['keyframes']} keyframes, truth {truth}, biases {report['biases']}")
    return "; ".join(parts) + "."


def _steps(steps: list[dict[str, Any]] | None) -> str:
    """What was taken out of a truth, in words; empty where nothing was, or its samples do not tell."""
    if not steps:
        return ""
    sizes = ", ".join(f"{1e3 * math.hypot(*step['shift_m']):.1f} mm" for step in steps)
    return f" (without its jump{'s' * (len(steps) > 1)} of {sizes}, which the accelerometer rules out)"


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("--table", type=int, choices=(1, 2, 3), required=True)
    arguments.add_argument("--covariance", type=Path, help="Table I: archive of covariances and ranks")
    arguments.add_argument(
        "--solutions", type=named_file, nargs="+", default=[], help="Tables II, III: NAME=solutions.csv"
    )
    arguments.add_argument(
        "--source", choices=("euroc", "rendered"), help="Table III: where the sequences are from"
    )
    arguments.add_argument("--errors", type=Path, help="Table III: errors and sigmas of the keyframes")
    arguments.add_argument("--spread", type=Path, help="Table III: spread over changes, if there is one")
    arguments.add_argument("--spread-stamp", type=Path, help="stamp of that spread")
    arguments.add_argument("--output", **STEM, help="the CSV; Markdown and LaTeX go beside it")
    arguments.add_argument(
        "--reports",
        type=named_file,
        nargs="+",
        default=[],
        help="Table III: NAME=report.json of the front-end",
    )
    add_published_names(arguments)
    add_published(arguments)
    run(work, arguments)


if __name__ == "__main__":
    main()
