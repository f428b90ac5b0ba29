"""Mean NEES over its degrees of freedom: every configuration and gauge, and what is broken on purpose."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from matplotlib.axes import Axes

from vigauge.files import write_rows

from ..experiments.nees import BROKEN, LAST, LIKELIHOOD, RIGHT, WITH_LANDMARKS
from .style import COLOURS, PAGE, new_figure, save_figure

# Marker, colour and legend of each row of the table.
_LOOK = {
    LIKELIHOOD: ("D", "#000000", "all parameters"),
    "fix": ("o", COLOURS["fix"], "motion, fixed gauge"),
    "keyframe": ("v", COLOURS["keyframe"], "motion, keyframe gauge"),
    "centroid": ("P", COLOURS["centroid"], "motion, centroid gauge"),
    "free": ("s", COLOURS["free"], "motion, free gauge"),
    WITH_LANDMARKS: ("X", COLOURS["free"], "motion, free with landmarks"),
    LAST: ("<", COLOURS["fix"], "last keyframe, fixed gauge"),
}
_BAND = "#D0D0D0"
_SPACING = 0.12


def draw_nees(table: Path, stem: Path) -> None:
    """Two panels from the table of experiment 'nees': as simulated; faults, each beside its mended twin."""
    rows = pd.read_csv(table)
    simulated = rows[rows["case"] == RIGHT]
    fixed = {mended: broken for broken, mended in BROKEN.items()}
    cases = [case for broken, mended in BROKEN.items() for case in (mended, broken)]
    with new_figure(PAGE, 3.9, 1, 2, width_ratios=(1.15, 1.0)) as (figure, axes):
        names = list(dict.fromkeys(simulated["configuration"]))
        for place, name in enumerate(names):
            _points(axes[0], simulated[simulated["configuration"] == name], place)
        axes[0].set_xticks(range(len(names)), [name.replace("_", "\n") for name in names])
        axes[0].set_title(f"As simulated: {_count(simulated)}")
        for place, case in enumerate(cases):
            _points(axes[1], rows[rows["case"] == case], place, hollow=case in fixed)
        axes[1].set_xticks(range(len(cases)), [_wrapped(case) for case in cases])
        axes[1].tick_params(axis="x", labelsize=6)
        axes[1].set_yscale("log")
        ticks = (0.8, 1.0, 1.25, 1.5, 2.0, 3.0, 4.0, 6.0)
        axes[1].set_yticks(ticks, [f"{tick:g}" for tick in ticks])
        axes[1].set_yticks([], minor=True)
        broken = rows[rows["case"].isin(BROKEN)]
        mended = rows[rows["case"].isin(fixed)]
        axes[1].set_title(f"Broken on purpose: {_count(broken, False)}\nmended (hollow): {_count(mended)}")
        axes[0].set_ylabel("Mean NEES / degrees of freedom")
        for panel in axes:
            panel.axhline(1.0, color="#808080", linewidth=0.6, zorder=0)
            panel.grid(True, axis="y")
        handles, labels = axes[0].get_legend_handles_labels()
        shown = dict(zip(labels, handles, strict=True))
        figure.legend(shown.values(), shown.keys(), loc="outside lower center", ncols=4)
        save_figure(figure, stem)
    write_rows(f"{stem}.csv", rows.to_dict("records"))


def _points(axes: Axes, rows: pd.DataFrame, place: int, hollow: bool = False) -> None:
    """The gauges of one case side by side, each on the band that it should be in."""
    for number, row in enumerate(rows.to_dict("records")):
        marker, colour, label = _LOOK[row["gauge"]]
        x = place + _SPACING * (number - 0.5 * (len(_LOOK) - 1))
        band = axes.vlines(x, row["low"] / row["dof"], row["high"] / row["dof"], _BAND, linewidth=5, zorder=1)
        band.set_label("where the mean should be")
        face = "white" if hollow else colour
        axes.plot(x, row["mean"] / row["dof"], marker, color=colour, markerfacecolor=face, label=label)


def _count(rows: pd.DataFrame, inside: bool = True) -> str:
    count = int((rows["inside"] == inside).sum())
    return f"{count} of {len(rows)} {'in' if inside else 'outside'} their band"


def _wrapped(case: str) -> str:
    return case.replace(" ", "\n")
