"""Figures 4, 5 and 6: accuracy, cost and path of the optimisation against the prior weight."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from vigauge.files import write_rows

from ..experiments.timing import timing_of
from .statistics import box_row, converged_only, from_row
from .style import COLUMN, PAGE, PUBLISHED, box_plot, new_figure, save_figure

_QUANTITIES = (
    ("p_rmse_m", "p_rmse_m", "Position (m)"),
    ("phi_rmse_deg", "phi_rmse_rad", "Rotation (deg)"),
    ("v_rmse_mps", "v_rmse_mps", "Velocity (m/s)"),
)
FREE = "free"
_LINES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1)))
_PATH_COLOURS = ("#000000", "#D55E00", "#009E73", "#0072B2", "#56B4E9")


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


def _span(values: np.ndarray) -> float:
    """Range over mean, in per cent."""
    return float(100.0 * (np.nanmax(values) - np.nanmin(values)) / np.nanmean(values))


def draw_accuracy(everything: pd.DataFrame, stem: Path, published: Path | None) -> None:
    """Figure 4: mean RMSE over the trials, each weight one step on the axis, with its change in per cent.

    The paper's curves (grey) have an axis of their own; each curve's span over its mean is stated.
    """
    sweep, _ = converged_only(everything)
    weights = _weights(everything)
    failed = _failed(everything)
    means = sweep.groupby("weight")[[name for name, _, _ in _QUANTITIES]].mean().reindex(weights)
    theirs = _published_rmse(published)
    with new_figure(COLUMN, 4.1, 3, 1, sharex=True) as (figure, axes):
        for panel, (name, their_name, label) in zip(axes, _QUANTITIES, strict=True):
            ours = means.loc[weights, name].to_numpy()
            panel.plot(range(len(weights)), ours, color="#5D3A9B", marker=".", label="ours")
            panel.ticklabel_format(axis="y", style="sci", scilimits=(0, 0), useOffset=False)
            panel.set_ylabel(label)
            panel.grid(True)
            spans = f"span {_span(ours):.2g} %"
            if theirs is not None:
                values = np.array([theirs[their_name].get(float(weight), np.nan) for weight in weights])
                spans += f" (paper {_span(values):.2g} %)"
                other = panel.twinx()
                other.plot(
                    range(len(weights)), values, color=PUBLISHED, marker=".", linestyle="--", label="paper"
                )
                other.ticklabel_format(axis="y", style="sci", scilimits=(0, 0), useOffset=False)
                other.tick_params(colors=PUBLISHED, labelsize=5.5)
                other.yaxis.get_offset_text().set(color=PUBLISHED, fontsize=5.5)
                if panel is axes[0]:
                    other.plot([], [], color="#5D3A9B", marker=".", label="ours")
                    figure.legend(
                        *other.get_legend_handles_labels(), loc="outside upper center", ncols=2, fontsize=6
                    )
            panel.set_title(spans, fontsize=6, loc="center", pad=2)
        axes[-1].set_xticks(range(len(weights)), weights, rotation=60)
        axes[-1].set_xlabel(_weight_label(failed))
        save_figure(figure, stem)
    rows = [
        {
            "weight": weight,
            **{name: float(means.loc[weight, name]) for name, _, _ in _QUANTITIES},
            "excluded": failed.get(weight, 0),
        }
        for weight in weights
    ]
    write_rows(f"{stem}.csv", rows)


def draw_cost(everything: pd.DataFrame, timing: pd.DataFrame, stem: Path, published: Path | None) -> None:
    """Figure 5: iterations and time of all trials, a box a weight; the paper's iterations in grey."""
    sweep, _ = converged_only(everything)
    failed = _failed(everything)
    timing = timing_of(timing, sweep, "weight")
    weights = _weights(everything)
    rows = []
    for quantity, table, column in (("iterations", sweep, "iterations"), ("time_s", timing, "seconds")):
        for weight in weights:
            values = table.loc[table["weight"] == weight, column].to_numpy()
            rows.append(
                box_row(values, weight=weight, quantity=quantity) | {"excluded": failed.get(weight, 0)}
            )
    table = pd.DataFrame(rows)
    with new_figure(COLUMN, 3.3, 2, 1, sharex=True) as (figure, axes):
        for panel, quantity, label in zip(
            axes, ("iterations", "time_s"), ("Number of iterations (#)", "Convergence time (s)"), strict=True
        ):
            boxes = [from_row(row) for _, row in table[table["quantity"] == quantity].iterrows()]
            box_plot(panel, boxes, list(range(len(weights))), 0.55, "#5D3A9B")
            panel.set_ylabel(label)
            panel.grid(True, axis="y")
        if published is not None:
            theirs = pd.read_csv(published / "fig05_prior_weight_cost.csv")
            theirs = theirs[theirs["quantity"] == "iterations"]
            numeric = [float(w) for w in weights]
            shared = [row for _, row in theirs.iterrows() if float(row["weight"]) in numeric]
            places = [numeric.index(float(row["weight"])) + 0.0 for row in shared]
            axes[0].plot(
                places, [row["median"] for row in shared], "x", color=PUBLISHED, label="paper, median"
            )
            axes[0].legend()
        axes[-1].set_xticks(range(len(weights)), weights, rotation=60)
        axes[-1].set_xlabel(_weight_label(failed))
        save_figure(figure, stem)
    write_rows(f"{stem}.csv", rows)


def draw_paths(
    sweep: pd.DataFrame, trace: pd.DataFrame, stem: Path, weights: list[str], published: Path | None
) -> None:
    """Figure 6: prior error of yaw and position against mean reprojection error, a dot an iteration.

    A path whose run did not converge says so in the legend, and in the numbers.
    """
    trace = trace[trace["trial"] == 0]
    status = sweep[sweep["trial"] == 0].set_index("weight")["status"].to_dict()
    failed = _failed(sweep[sweep["trial"] == 0])
    theirs = None if published is None else pd.read_csv(published / "fig06_prior_error_paths.csv")
    panels = (
        ("prior_yaw_rad", "yaw_rad", "Yaw prior error (rad)"),
        ("prior_position_m", "position_m", "Position prior error (m)"),
    )
    with new_figure(PAGE, 2.7, 1, 2) as (figure, axes):
        for panel, (column, their_panel, label) in zip(axes, panels, strict=True):
            if theirs is not None:
                for number, (_, path) in enumerate(
                    theirs[theirs["panel"] == their_panel].groupby("weight", sort=False)
                ):
                    x, y = path["mean_reprojection_px"], path["prior_error"]
                    mark = "paper" if number == 0 else None
                    panel.plot(x, y, color=PUBLISHED, marker=".", markersize=2, linewidth=0.5, label=mark)
            for weight, colour, style in zip([FREE, *weights], _PATH_COLOURS, _LINES, strict=True):
                path = trace[trace["weight"] == weight]
                label_of = "Free" if weight == FREE else f"$w^P$ = {weight}"
                label_of += f" ({status[weight]})" if weight in failed else ""
                x, y = path["mean_reprojection_px"], path[column]
                panel.plot(x, y, color=colour, linestyle=style, marker="o", markersize=2.5, label=label_of)
            start = trace[(trace["weight"] == FREE) & (trace["iteration"] == 0)].iloc[0]
            panel.annotate(
                "start",
                (start["mean_reprojection_px"], 0.0),
                (-6, 5),
                textcoords="offset points",
                ha="center",
                fontsize=6,
            )
            panel.set_xlabel("Average reprojection error (px)")
            panel.set_ylabel(label)
            panel.grid(True)
        axes[1].legend()
        save_figure(figure, stem)
    shown = trace[trace["weight"].isin([FREE, *weights])]
    columns = ["weight", "iteration", "mean_reprojection_px", "prior_yaw_rad", "prior_position_m", "cost"]
    shown = shown[columns].assign(status=shown["weight"].map(status))
    write_rows(f"{stem}.csv", shown.to_dict("records"))
