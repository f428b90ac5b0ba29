"""The gauges compared with biases in the state, beside the same with known biases."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pandas as pd
from matplotlib.axes import Axes

from ..ids import BIAS_ERRORS, ERRORS, ESTIMATED, FREE, KNOWN, PRIOR
from .style import COLOURS, LABELS, MARKERS, PAGE, new_figure, save_figure

_ERRORS = dict(
    zip(
        (*ERRORS, *BIAS_ERRORS),
        ("position", "rotation", "velocity", "gyro bias", "accel. bias"),
        strict=True,
    )
)
_ITERATIONS = {"iterations": "all but sine random"}
_TIME = {"seconds_per_iteration": "of an iteration"}
_DISTANCES = {
    "relative_frobenius_same_point": "at one point",
    "relative_frobenius_converged": "between estimates",
}
_BAND, _GREY = "#E4E4E4", "#808080"
_OFFSET = {(KNOWN, FREE): -0.24, (ESTIMATED, FREE): -0.08, (KNOWN, PRIOR): 0.08, (ESTIMATED, PRIOR): 0.24}


def draw_biases(table: Path, stem: Path) -> None:
    """Four panels from the claims judged on experiment 'biases': errors, iterations, time, covariances."""
    rows = pd.read_csv(table)
    limits = rows.groupby("quantity")["margin"].max()
    with new_figure(PAGE, 3.1, 1, 4, width_ratios=(2.6, 0.9, 0.9, 1.1)) as (figure, axes):
        errors, iterations, time, covariances = axes
        _panel(errors, rows, _ERRORS, "Errors: difference\nto fixation (%)", scale=100.0)
        margin = 100.0 * float(limits.reindex(list(_ERRORS)).max())
        errors.axhspan(-margin, margin, color=_BAND, zorder=0, label="counts as the same")
        _panel(iterations, rows, _ITERATIONS, "Iterations: difference\nto fixation")
        _panel(time, rows, _TIME, "Time: ratio\nto fixation")
        for panel, same in ((errors, 0.0), (iterations, 0.0), (time, 1.0)):
            panel.axhline(same, color=_GREY, linewidth=0.6, zorder=1)
        _panel(covariances, rows, _DISTANCES, "Eq. (12): relative\ndistance to fixed")
        covariances.set_yscale("log")
        for place, quantity in enumerate(_DISTANCES):
            if quantity in limits:
                ends = place - 0.4, place + 0.4
                line = covariances.hlines(limits[quantity], *ends, _GREY, linewidth=0.8, linestyle="--")
                line.set_label("limit")
        named = (
            pair for panel in axes for pair in zip(*reversed(panel.get_legend_handles_labels()), strict=True)
        )
        shown = dict(named)
        figure.legend(shown.values(), shown.keys(), loc="outside lower center", ncols=3)
        save_figure(figure, stem)


def _panel(axes: Axes, rows: pd.DataFrame, names: Mapping[str, str], title: str, scale: float = 1.0) -> None:
    """Estimates and intervals of some quantities: hollow with known biases, filled with estimated ones."""
    for place, quantity in enumerate(names):
        for row in rows[rows["quantity"] == quantity].to_dict("records"):
            gauge, biases = row["gauge"], row["biases"]
            x, colour = place + _OFFSET[biases, gauge], COLOURS[gauge]
            axes.vlines(x, scale * row["low"], scale * row["high"], colour, linewidth=1.2)
            axes.plot(
                x,
                scale * row["estimate"],
                MARKERS[gauge],
                color=colour,
                markerfacecolor="white" if biases == KNOWN else colour,
                label=f"{LABELS[gauge]}, {biases} biases",
            )
    axes.set_xticks(range(len(names)), [name.replace(" ", "\n", 1) for name in names.values()])
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.set_title(title)
    axes.grid(True, axis="y")
