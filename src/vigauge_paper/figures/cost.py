"""Figures 7 and 11: time, iterations and time per iteration of the three gauges.

A trial counts with its quickest repeat. Time per iteration is the median over trials (of a sequence: over
repeats) of the ratio to gauge fixation in the same trial, with the 95 % interval of that median.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from vigauge.files import write_rows

from ..experiments.timing import read_timing, timing_of
from ..ids import GAUGES
from .statistics import box_row, converged_only, from_row, median_interval, time_per_iteration_ratios
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

_OFFSET = {"fix": -0.36, "free": -0.06, "prior": 0.24}
# Darker than what is the paper's elsewhere: small crosses on top of boxes.
_CROSS = "#4D4D4D"
_BAND = "1 ± 2 %"
TIME, RATIO = "time_s", "time_per_iteration_ratio"
_AXES = (
    (TIME, "Time (ms)"),
    ("iterations", "Iterations (#)"),
    (RATIO, "Time per iteration\nover fix (ratio)"),
)
_SCALED = ("whisker_low", "q1", "median", "q3", "whisker_high", "median_low", "median_high")


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
            (TIME, times),
            ("iterations", counts),
            (RATIO, ratios.get(gauge, np.empty(0))),
        ):
            low, high = median_interval(values)
            rows.append(
                {
                    **box_row(values, **labels, quantity=quantity),
                    "mean": float(np.mean(values)) if len(values) else float("nan"),
                    "excluded": excluded,
                    "median_low": low,
                    "median_high": high,
                }
            )
    return rows


def _published(table: pd.DataFrame, their_name: str, quantity: str, gauge: str) -> float:
    """The paper's median, or the ratio that its figure shows; NaN where it has none."""
    key = table.columns[0]
    row = table[(table[key] == their_name) & (table["quantity"] == quantity) & (table["gauge"] == gauge)]
    if not len(row):
        return float("nan")
    return float(row["value" if quantity == RATIO else "median"].iloc[0])


def _factor(table: pd.DataFrame, theirs: pd.DataFrame | None, published: Mapping[str, str]) -> float:
    """The paper's times over ours, two digits: the middle of experiments and gauges; NaN without a pair."""
    if theirs is None:
        return float("nan")
    ratios = np.array(
        [
            _published(theirs, published[row["experiment"]], TIME, row["gauge"]) / row["median"]
            for _, row in table[table["quantity"] == TIME].iterrows()
        ]
    )
    ratios = ratios[np.isfinite(ratios)]
    return float(f"{np.median(ratios):.2g}") if len(ratios) else float("nan")


def _draw_gauge(
    panel: Axes, quantity: str, own: pd.DataFrame, places: list[float], gauge: str, label: str
) -> None:
    """A gauge's boxes with a mark at each median; of ratios the marks and their 95 % intervals."""
    middle = own["median"].to_numpy()
    look = {"marker": MARKERS[gauge], "color": COLOURS[gauge], "linestyle": "none", "label": label}
    if quantity == RATIO:
        reach = np.array([middle - own["median_low"], own["median_high"] - middle])
        panel.errorbar(places, middle, yerr=reach, elinewidth=0.9, capsize=1.5, **look)
        return
    box_plot(panel, [from_row(row) for _, row in own.iterrows()], places, 0.15, COLOURS[gauge])
    panel.plot(places, middle, markersize=2.5, **look)


def draw_cost(
    solutions: Mapping[str, Path],
    timings: Mapping[str, Path],
    published: Mapping[str, str],
    published_file: Path | None,
    stem: Path,
    rendered: bool = False,
) -> None:
    """Three panels, a group of boxes an experiment.

    ``published`` maps an experiment to its name in ``published_file``, whose medians are crosses.
    Its times belong to another machine: they have the axis on the right, a stated multiple of ours.
    """
    rows = [row for name in solutions for row in cost_rows(name, solutions[name], timings[name])]
    table = pd.DataFrame(rows)
    theirs = None if published_file is None else pd.read_csv(published_file)
    factor = _factor(table, theirs, published)
    wide = len(solutions) < 4
    shape, size = ((1, 3), (PAGE, 2.6)) if wide else ((3, 1), (COLUMN, 4.7))
    with new_figure(*size, *shape, sharex=True) as (figure, axes):
        for panel, (quantity, label) in zip(axes, _AXES, strict=True):
            unit = 1e3 if quantity == TIME else 1.0
            for gauge in GAUGES:
                own = table[(table["gauge"] == gauge) & (table["quantity"] == quantity)]
                own = own.set_index("experiment").loc[list(solutions), list(_SCALED)] * unit
                places = [number + _OFFSET[gauge] for number in range(len(solutions))]
                _draw_gauge(panel, quantity, own, places, gauge, LABELS[gauge])
                if theirs is not None:
                    scale = unit / factor if quantity == TIME else 1.0
                    values = [
                        scale * _published(theirs, published[name], quantity, gauge) for name in solutions
                    ]
                    mark = "paper" if gauge == GAUGES[-1] else None
                    beside = [place + 0.15 for place in places]
                    panel.plot(beside, values, "x", color=_CROSS, markersize=3.5, zorder=3, label=mark)
            if quantity == RATIO:
                panel.axhspan(0.98, 1.02, color=PUBLISHED, alpha=0.25, linewidth=0, label=_BAND)
                panel.yaxis.set_major_locator(MaxNLocator(8, steps=[1, 2, 5, 10]))
            else:
                # Room above what is highest, so that marks at the edge are whole.
                panel.yaxis.set_major_locator(MaxNLocator(7, steps=[1, 2, 5, 10], integer=quantity != TIME))
                top = panel.dataLim.y1
                panel.set_ylim(0.0, 1.08 * top if np.isfinite(top) else 1.0)
            if quantity == TIME and np.isfinite(factor):
                right = panel.secondary_yaxis("right", functions=(lambda y: y * factor, lambda y: y / factor))
                right.tick_params(colors=_CROSS)
                right.set_ylabel(f"paper (ms), {factor:g} × left", color=_CROSS)
            panel.set_ylabel(label)
            panel.grid(True, axis="y")
        for panel in axes if wide else axes[-1:]:
            panel.set_xticks(range(len(solutions)), _tick_labels(solutions, rows, wrapped=not wide))
            panel.tick_params(axis="x", labelsize=6.5)
        named = dict(zip(*reversed(axes[-1].get_legend_handles_labels()), strict=True))
        shown = [name for name in (*LABELS.values(), "paper", _BAND) if name in named]
        figure.legend(
            [named[name] for name in shown], shown, loc="outside lower center", ncols=5,
            handletextpad=0.3, columnspacing=0.9,
        )  # fmt: skip
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
