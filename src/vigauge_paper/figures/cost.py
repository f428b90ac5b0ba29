"""Figures 7 and 11: time, iterations and time per iteration of the three gauges.

A trial counts with its quickest repeat. Time per iteration is the median over trials (of a sequence: over
repeats) of the ratio to gauge fixation in the same trial, with the middle half of the ratios.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from vigauge.files import write_rows

from ..experiments.timing import read_timing, timing_of
from ..ids import FIX, GAUGES
from .statistics import box_row, converged_only, from_row, time_per_iteration_ratios
from .style import (
    COLOURS,
    COLUMN,
    LABELS,
    MARKERS,
    PAGE,
    PUBLISHED,
    box_plot,
    new_figure,
    note_stand_in,
    save_figure,
)

_OFFSET = {"fix": -0.26, "free": 0.0, "prior": 0.26}
_AXES = (
    ("time_s", "Time (s)"),
    ("iterations", "Iterations (#)"),
    ("time_per_iteration_ratio", "Time per iter. (ratio)"),
)


def cost_rows(name: str, solutions: Path, timing: Path) -> list[dict[str, object]]:
    """Box statistics of time, iterations and paired ratios of one experiment, a row each."""
    everything = pd.read_csv(solutions).query("noise == 'headline'")
    solved, _ = converged_only(everything)
    timed = timing_of(read_timing(timing, name), solved)
    ratios = time_per_iteration_ratios(timed)
    rows = []
    for gauge in GAUGES:
        labels = {"experiment": name, "gauge": gauge}
        _, excluded = converged_only(everything[everything["gauge"] == gauge])
        times = timed.loc[timed["gauge"] == gauge, "seconds"].to_numpy()
        counts = solved.loc[solved["gauge"] == gauge, "iterations"].to_numpy()
        for quantity, values in (
            ("time_s", times),
            ("iterations", counts),
            ("time_per_iteration_ratio", ratios.get(gauge, np.empty(0))),
        ):
            rows.append(
                {
                    **box_row(values, **labels, quantity=quantity),
                    "mean": float(np.mean(values)) if len(values) else float("nan"),
                    "excluded": excluded,
                }
            )
    return rows


def _published(table: pd.DataFrame, their_name: str, quantity: str, gauge: str) -> float:
    """The paper's median, or the ratio that its figure shows; NaN where it has none."""
    key = table.columns[0]
    row = table[(table[key] == their_name) & (table["quantity"] == quantity) & (table["gauge"] == gauge)]
    if not len(row):
        return float("nan")
    return float(row["value" if quantity == "time_per_iteration_ratio" else "median"].iloc[0])


def draw_cost(
    solutions: Mapping[str, Path],
    timings: Mapping[str, Path],
    published: Mapping[str, str],
    published_file: Path | None,
    stem: Path,
    rendered: bool = False,
) -> None:
    """Three panels, a group of boxes an experiment.

    ``published`` maps an experiment to its name in ``published_file``, whose iterations and
    ratios are marked in grey (its times belong to another machine).
    """
    rows = [row for name in solutions for row in cost_rows(name, solutions[name], timings[name])]
    table = pd.DataFrame(rows)
    theirs = None if published_file is None else pd.read_csv(published_file)
    wide = len(solutions) < 4
    shape, size = ((1, 3), (PAGE, 2.4)) if wide else ((3, 1), (COLUMN, 4.3))
    with new_figure(*size, *shape, sharex=True) as (figure, axes):
        for panel, (quantity, label) in zip(axes, _AXES, strict=True):
            for gauge in GAUGES:
                own = table[(table["gauge"] == gauge) & (table["quantity"] == quantity)].set_index(
                    "experiment"
                )
                places = [number + _OFFSET[gauge] for number in range(len(solutions))]
                stats = [own.loc[name] for name in solutions]
                if quantity == "time_per_iteration_ratio":
                    middle = np.array([row["median"] for row in stats])
                    error = [middle - [row["q1"] for row in stats], [row["q3"] for row in stats] - middle]
                    panel.errorbar(
                        places,
                        middle,
                        yerr=error,
                        fmt=MARKERS[gauge],
                        color=COLOURS[gauge],
                        elinewidth=0.7,
                        label=LABELS[gauge],
                    )
                else:
                    box_plot(panel, [from_row(row) for row in stats], places, 0.2, COLOURS[gauge])
                    panel.plot([], [], color=COLOURS[gauge], marker=MARKERS[gauge], label=LABELS[gauge])
                if theirs is not None and quantity != "time_s":
                    values = [_published(theirs, published[name], quantity, gauge) for name in solutions]
                    mark = "paper" if gauge == FIX else None
                    panel.plot(places, values, "x", color=PUBLISHED, markersize=4, label=mark)
            panel.set_ylabel(label)
            panel.grid(True, axis="y")
            if quantity != "time_per_iteration_ratio":
                panel.set_ylim(bottom=0.0)
        for panel in axes if wide else axes[-1:]:
            panel.set_xticks(range(len(solutions)), _tick_labels(solutions, rows, wrapped=not wide))
            panel.tick_params(axis="x", labelsize=6.5)
        axes[1].legend(
            ncols=4 if not wide else 1, fontsize=6, loc="lower right", handletextpad=0.3, columnspacing=0.8
        )
        note_stand_in(figure, rendered)
        save_figure(figure, stem)
    write_rows(f"{stem}.csv", rows)


def _tick_labels(names: Iterable[str], rows: list[dict[str, object]], wrapped: bool) -> list[str]:
    """Names of experiments, on two lines where narrow, and how many of their runs were left out."""
    table = pd.DataFrame(rows).drop_duplicates(["experiment", "gauge"])
    excluded = table.groupby("experiment")["excluded"].sum()
    return [
        (name.replace("_", "\n", 1) if wrapped else name.replace("_", " "))
        + (f"\n({excluded[name]} not conv.)" if excluded[name] else "")
        for name in names
    ]
