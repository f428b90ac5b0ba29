"""Figures 4, 5 and 6: accuracy, cost and path of the optimisation against the prior weight."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator

from vigauge.files import write_rows

from ..experiments.timing import timing_of
from ..prior import MEANING
from .statistics import box_row, converged_only, from_row
from .style import (
    COLOURS,
    COLUMN,
    OTHERS,
    PAGE,
    PRIOR_SHADES,
    PUBLISHED,
    READING_COLOURS,
    box_plot,
    new_figure,
    save_figure,
)

_QUANTITIES = (
    ("p_rmse_m", "p_rmse_m", "Position", "m"),
    ("phi_rmse_deg", "phi_rmse_rad", "Rotation", "deg"),
    ("v_rmse_mps", "v_rmse_mps", "Velocity", "m/s"),
)
FREE = "free"
_LINES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1)))
_PATH_PANELS = (
    ("prior_yaw_rad", "yaw_rad", "Yaw prior error (rad)"),
    ("prior_position_m", "position_m", "Position prior error (m)"),
)
_OWN = "Ours"
# Fig. 6: linear below this error, so that zero has a place; labels of iterations that are nearer than these
# decades would overlap.
_FLOOR = 1e-6
_LABEL_DECADES = 0.25


def _weights(sweep: pd.DataFrame) -> list[str]:
    """Weights of the sweep in their order, the free gauge left out."""
    return [weight for weight in dict.fromkeys(sweep["weight"]) if weight != FREE]


def _failed(sweep: pd.DataFrame) -> dict[str, int]:
    """Number of runs that did not converge, by weight, where there are any."""
    counts = (~sweep["converged"]).groupby(sweep["weight"], sort=False).sum()
    return {str(weight): int(count) for weight, count in counts.items() if count}


def _weight_label(failed: dict[str, int]) -> str:
    """Label of the axis of weights, with what is left out of the means and boxes."""
    shown = ", ".join(f"{count} at {weight}" for weight, count in failed.items() if weight != FREE)
    return "Prior weight" + (f"\nleft out, not converged: {shown}" if shown else "")


def read_sweep(file: Path, reading: str) -> pd.DataFrame:
    """A table of the sweep under one reading of the weights."""
    table = pd.read_csv(file, dtype={"weight": str})
    return table[table["reading"] == reading].drop(columns="reading")


def _published_rmse(folder: Path | None) -> pd.DataFrame | None:
    """Published means by numeric weight. Fig. 4's rotations are degrees, whatever its label says."""
    if folder is None:
        return None
    table = pd.read_csv(folder / "fig04_prior_weight_rmse.csv")
    return table.assign(key=table["weight"].fillna(table["weight_guess"]).astype(float)).set_index("key")


def _change(values: np.ndarray) -> np.ndarray:
    """Change against the first weight that has a value, in per cent."""
    known = values[np.isfinite(values)]
    return 100.0 * (values / known[0] - 1.0) if len(known) else values


def _span(values: np.ndarray) -> float:
    """Range over mean, in per cent."""
    return float(100.0 * (np.nanmax(values) - np.nanmin(values)) / np.nanmean(values))


def _weight_axis(axes: Axes, weights: list[str], failed: dict[str, int]) -> None:
    """Each weight one step, whatever lies between."""
    axes.set_xticks(range(len(weights)), weights, rotation=60)
    axes.set_xlabel(_weight_label(failed))


def draw_accuracy(everything: pd.DataFrame, stem: Path, published: Path | None) -> None:
    """Figure 4: mean RMSE over the trials as change in per cent, the paper's on the same axis.

    Each weight is one step. Legends have the mean and the span (range over mean) of both; the numbers beside
    have means and changes.
    """
    sweep, _ = converged_only(everything)
    weights = _weights(everything)
    failed = _failed(everything)
    means = sweep.groupby("weight")[[name for name, *_ in _QUANTITIES]].mean().reindex(weights)
    changes = means.apply(lambda column: _change(column.to_numpy()))
    theirs = _published_rmse(published)
    with new_figure(COLUMN, 4.3, 3, 1, sharex=True, sharey=True) as (figure, axes):
        for panel, (name, their_name, title, unit) in zip(axes, _QUANTITIES, strict=True):
            curves = [("ours", means[name].to_numpy(), "o-", OTHERS[0])]
            if theirs is not None:
                values = np.array([theirs[their_name].get(float(weight), np.nan) for weight in weights])
                curves.append(("paper", values, "x--", PUBLISHED))
            for source, values, style, colour in curves:
                label = f"{source}: mean {np.nanmean(values):.2g} {unit}, span {_span(values):.2g} %"
                panel.plot(range(len(weights)), _change(values), style, color=colour, label=label)
            panel.set_title(title, pad=3)
            panel.grid(True)
            panel.legend(loc="upper right")
        axes[1].set_ylabel(f"Change of the RMSE against weight {weights[0]} (%)")
        low, high = axes[0].get_ylim()
        axes[0].set_ylim(low, high + 0.6 * (high - low))  # room for the legends
        _weight_axis(axes[-1], weights, failed)
        save_figure(figure, stem)
    rows = [
        {
            "weight": weight,
            **{name: float(means.loc[weight, name]) for name, *_ in _QUANTITIES},
            "excluded": failed.get(weight, 0),
            **{f"{name}_change_percent": float(changes.loc[weight, name]) for name, *_ in _QUANTITIES},
        }
        for weight in weights
    ]
    write_rows(f"{stem}.csv", rows)


def _cost_boxes(reading: str, everything: pd.DataFrame, timing: pd.DataFrame) -> pd.DataFrame:
    """A box a weight of iterations and of time, under one reading."""
    sweep, _ = converged_only(everything)
    failed = _failed(everything)
    timing = timing_of(timing, sweep, "weight")
    return pd.DataFrame(
        box_row(table.loc[table["weight"] == weight, column].to_numpy(), weight=weight, quantity=quantity)
        | {"excluded": failed.get(weight, 0), "reading": reading}
        for quantity, table, column in (("iterations", sweep, "iterations"), ("time_s", timing, "seconds"))
        for weight in _weights(everything)
    )


def draw_cost(
    sweeps: Mapping[str, pd.DataFrame],
    timings: Mapping[str, pd.DataFrame],
    stem: Path,
    published: Path | None,
) -> None:
    """Figure 5: iterations and time of all trials, a box a weight and reading; grey: the paper's iterations.

    ``sweeps``, ``timings``: tables by reading, the one that leads first.
    """
    table = pd.concat([_cost_boxes(name, sweeps[name], timings[name]) for name in sweeps])
    weights = _weights(next(iter(sweeps.values())))
    boxes = {
        (f"ours, weight {MEANING[name]}", READING_COLOURS[name]): table[table["reading"] == name]
        for name in sweeps
    }
    if published is not None:
        theirs = pd.read_csv(published / "fig05_prior_weight_cost.csv").query("quantity == 'iterations'")
        names = {float(weight): weight for weight in weights}
        boxes["paper", PUBLISHED] = theirs.assign(weight=theirs["weight"].astype(float).map(names))
    with new_figure(PAGE, 4.0, 2, 1, sharex=True) as (figure, axes):
        for number, ((label, colour), shown) in enumerate(boxes.items()):
            offset = 0.26 * (number - 0.5 * (len(boxes) - 1))
            for panel, quantity in zip(axes, ("iterations", "time_s"), strict=True):
                rows = shown[(shown["quantity"] == quantity) & shown["weight"].notna()]
                places = [weights.index(weight) + offset for weight in rows["weight"]]
                box_plot(panel, [from_row(row) for _, row in rows.iterrows()], places, 0.2, colour)
            axes[0].plot([], [], "s", color=colour, markerfacecolor="none", label=label)
        for panel, label in zip(axes, ("Number of iterations (#)", "Convergence time (s)"), strict=True):
            panel.set_ylabel(label)
            panel.set_ylim(bottom=0.0)
            panel.set_xlim(-0.6, len(weights) - 0.4)
            panel.grid(True, axis="y")
            for edge in range(1, len(weights)):
                panel.axvline(edge - 0.5, color="0.9", linewidth=0.5, zorder=0)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
        _weight_axis(axes[-1], weights, _failed(pd.concat(sweeps.values())))
        save_figure(figure, stem)
    write_rows(f"{stem}.csv", table.to_dict("records"))


def _ranges(heights: np.ndarray) -> list[tuple[str, float]]:
    """Iterations from the first on as text, with their height: '3' or, where labels would overlap, '3–5'."""

    def height(group: list[int]) -> float:
        return float(np.mean(heights[[group[0], group[-1]]]))

    groups: list[list[int]] = []
    for step in range(1, len(heights)):
        if groups and abs(heights[step] - heights[groups[-1][0]]) < _LABEL_DECADES:
            groups[-1].append(step)
        else:
            groups.append([step])
    apart: list[list[int]] = []
    for group in groups:
        # A label stands in the middle of its group, so that two may be nearer than their groups.
        while apart and abs(height(group) - height(apart[-1])) < _LABEL_DECADES:
            group = apart.pop() + group
        apart.append(group)
    return [(f"{g[0]}–{g[-1]}" if len(g) > 1 else f"{g[0]}", height(g)) for g in apart]


def _draw_path(panel: Axes, column: int, weight: str, pixels: np.ndarray, errors: np.ndarray) -> None:
    """One path: dots that grow with the iteration, and the iterations' numbers in a column."""
    colour, style = (COLOURS[FREE], *PRIOR_SHADES)[column], _LINES[column]
    panel.plot(pixels, errors, color=colour, linestyle=style)
    panel.scatter(pixels, errors, s=3.0 + 2.5 * np.arange(len(errors)), color=colour, linewidth=0, zorder=3)
    place = 0.045 + 0.08 * column
    look = {"color": colour, "ha": "center", "fontsize": 7}
    panel.text(place, 1.02, weight, transform=panel.transAxes, fontweight="bold", **look)
    for text, height in _ranges(np.log10(np.maximum(errors, _FLOOR))):
        y = 10.0**height if height > np.log10(_FLOOR) else 0.0
        panel.text(place, y, text, transform=panel.get_yaxis_transform(), va="center", **look)


def _pixel_axis(panel: Axes, low: float, high: float) -> None:
    """Logarithmic axis of reprojection errors, with room on the left for the columns of iterations."""
    span = np.log10(high / low)
    panel.set_xlim(low / 10.0 ** (0.85 * span), high * 10.0 ** (0.2 * span))
    panel.axvspan(panel.get_xlim()[0], low / 10.0 ** (0.07 * span), color="#F2F2F2", zorder=0)
    ticks = [n * 10.0**k for k in range(-3, 4) for n in (1, 2, 5)]
    ticks = [tick for tick in ticks if low / 1.2 <= tick <= 1.2 * high]
    panel.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    panel.xaxis.set_minor_locator(NullLocator())


def draw_paths(
    sweep: pd.DataFrame, trace: pd.DataFrame, stem: Path, weights: list[str], published: Path | None
) -> None:
    """Figure 6: prior error of yaw and position against mean reprojection error, a dot an iteration.

    The paper's paths have a row of their own, above ours. Errors are on a logarithmic axis down to
    1e-6, and linear below, where the start and very strong priors are. Left of the paths, below each
    weight, stand the numbers of the iterations at their heights. A path whose run did not converge
    says so in a corner of ours, and in the numbers.
    """
    trace = trace[trace["trial"] == 0]
    status = sweep[sweep["trial"] == 0].set_index("weight")["status"].to_dict()
    failed = _failed(sweep[sweep["trial"] == 0])
    drawn = {_OWN: trace[trace["weight"].isin([FREE, *weights])]}
    if published is not None:
        table = pd.read_csv(published / "fig06_prior_error_paths.csv", dtype={"weight": str})
        wide = table.pivot(
            index=["weight", "step", "mean_reprojection_px"], columns="panel", values="prior_error"
        )
        drawn = {"Paper": wide.rename(columns={t: o for o, t, _ in _PATH_PANELS}).reset_index(), **drawn}
    pixels = pd.concat(drawn.values())["mean_reprojection_px"]
    notes = [f"{weight} ({status[weight]})" for weight in failed if weight in (FREE, *weights)]
    with new_figure(
        PAGE, 0.4 + 2.4 * len(drawn), len(drawn), 2, sharex=True, sharey="col", squeeze=False
    ) as (figure, axes):
        for row, (whose, paths) in zip(axes, drawn.items(), strict=True):
            for panel, (column, _, label) in zip(row, _PATH_PANELS, strict=True):
                panel.set_xscale("log")
                panel.set_yscale("symlog", linthresh=_FLOOR, linscale=0.5)
                for number, weight in enumerate([FREE, *weights]):
                    path = paths[paths["weight"] == weight].dropna(subset=column)
                    x, y = (path[name].to_numpy() for name in ("mean_reprojection_px", column))
                    _draw_path(panel, number, weight, x, y)
                _pixel_axis(panel, pixels.min(), pixels.max())
                panel.set_ylabel(label)
                panel.grid(True)
                panel.set_title(f"{whose}; iterations (left) by prior weight $w^P$", pad=15, loc="left")
                start = paths["mean_reprojection_px"].max()
                panel.annotate("start", (start, 0.0), (2, 5), textcoords="offset points", fontsize=7)
                if whose == _OWN:
                    panel.text(0.98, 0.97, "\n".join(notes), transform=panel.transAxes, ha="right", va="top")
        for panel in axes[-1]:
            panel.set_xlabel("Average reprojection error (px)")
        save_figure(figure, stem)
    columns = ["weight", "iteration", "mean_reprojection_px", "prior_yaw_rad", "prior_position_m", "cost"]
    shown = drawn[_OWN][columns].assign(status=drawn[_OWN]["weight"].map(status))
    write_rows(f"{stem}.csv", shown.to_dict("records"))
