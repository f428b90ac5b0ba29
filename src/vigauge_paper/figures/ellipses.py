"""Figure 1: where the uncertainty of the positions lies in the free and in the fixed gauge, and how it grows.

Ellipses are those of the 2 x 2 covariance of (x, y), one standard deviation, all of a flight enlarged
alike. (The paper's have variances as axis lengths and no correlation.)
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse

from vigauge.files import write_rows
from vigauge.geometry.so3 import Array
from vigauge.model.archive import load_arrays

from .style import COLOURS, PAGE, draw_withheld, new_figure, note_stand_in, save_figure

# Share of the flight's extent that the largest ellipse may take.
_LARGEST_SHARE = 0.12
# Name, colour, width and dashes: the fixed curve lies on the transformed one, and both are seen.
_LOOKS = {
    "free": ("free gauge", COLOURS["free"], 0.9, "-"),
    "transformed": ("free gauge, transformed to the fixed one", "#F5B78A", 2.6, "-"),
    "fixed": ("gauge fixation", COLOURS["fix"], 0.9, "--"),
}
_ROWS = ("Free gauge\ny (m)", "Gauge fixation\ny (m)", "One sigma, longest\ndirection (mm)")
_PAPER_GROUND = "#F0F0F0"

Ellipses = list[dict[str, float]]
# Positions (N, 2 or 3) and ellipses of each curve of a flight.
Curves = Mapping[str, tuple[Array, Ellipses]]


def xy_ellipses(covariance: Array, n_keyframes: int) -> Ellipses:
    """Semi-axes (m, one sigma) and direction (rad, of the major axis from x) for each keyframe."""
    out = []
    for keyframe in range(n_keyframes):
        block = covariance[3 * keyframe : 3 * keyframe + 2, 3 * keyframe : 3 * keyframe + 2]
        values, vectors = np.linalg.eigh(block)
        minor, major = np.sqrt(np.maximum(values, 0.0))
        angle = float(np.arctan2(vectors[1, 1], vectors[0, 1]))
        out.append({"semi_major_m": float(major), "semi_minor_m": float(minor), "angle_rad": angle})
    return out


def enlargement(extent_m: float, largest_m: float) -> float:
    """The largest of 1, 2, 5, 10, ... that keeps the largest ellipse readable."""
    wanted = _LARGEST_SHARE * extent_m / largest_m
    steps = [m * 10.0**k for k in range(6) for m in (1, 2, 5)]
    return max([step for step in steps if step <= wanted], default=1.0)


def _draw(axes: Axes, p_W: Array, ellipses: Ellipses, scale: float, name: str) -> None:
    label, colour, width, style = _LOOKS[name]
    axes.plot(p_W[:, 0], p_W[:, 1], style, color=colour, linewidth=0.5 * width, label=label)
    for centre, ellipse in zip(p_W, ellipses, strict=True):
        axes.add_patch(
            Ellipse(
                (centre[0], centre[1]),
                2 * scale * ellipse["semi_major_m"],
                2 * scale * ellipse["semi_minor_m"],
                angle=np.degrees(ellipse["angle_rad"]),
                fill=False,
                edgecolor=colour,
                linewidth=0.7 * width,
                linestyle=style,
            )
        )


def published_ellipses(file: Path, curve: str) -> tuple[Array, Ellipses]:
    """Positions (N, 2) and one-sigma ellipses of a curve of the paper's Fig. 1: no correlation of x and y.

    The paper has variances as lengths of axes; here they are standard deviations, as ours.
    """
    table = pd.read_csv(file)
    rows = table[(table["curve"] == curve) & (table["record"] == "ellipse")].sort_values("keyframe")
    deviation = np.sqrt(rows[["var_x_m2", "var_y_m2"]].to_numpy())
    ellipses = [
        {
            "semi_major_m": float(max(x, y)),
            "semi_minor_m": float(min(x, y)),
            "angle_rad": 0.0 if x >= y else np.pi / 2,
        }
        for x, y in deviation
    ]
    return rows[["x", "y"]].to_numpy(), ellipses


def _scale(curves: Curves) -> float:
    extent = float(np.ptp(curves["free"][0][:, :2], axis=0).max())
    return enlargement(extent, max(e["semi_major_m"] for _, ellipses in curves.values() for e in ellipses))


def _width(curves: Curves) -> float:
    """Width of a flight's panels over that of a square one."""
    width, height = np.ptp(curves["free"][0][:, :2], axis=0)
    return float(np.clip(width / max(height, 1e-9), 0.8, 1.6))


def _draw_flight(panels: Sequence[Axes], title: str, curves: Curves) -> None:
    """A column: ellipses in the free gauge, in the fixed one, and how long they are."""
    scale = _scale(curves)
    for panel, names in zip(panels, (("free",), ("transformed", "fixed")), strict=False):
        for name in names:
            _draw(panel, *curves[name], scale, name)
        panel.plot(*curves[names[0]][0][0, :2], "ko", label="first keyframe")
        panel.set_aspect("equal", adjustable="datalim")
        panel.margins(0.12)
        panel.set_xlabel("x (m)", labelpad=1)
    for name, (label, colour, width, style) in _LOOKS.items():
        sigma_mm = [1e3 * ellipse["semi_major_m"] for ellipse in curves[name][1]]
        panels[2].plot(range(len(sigma_mm)), sigma_mm, style, color=colour, linewidth=width, label=label)
    panels[2].set_ylim(bottom=0.0)
    panels[2].set_xlabel("keyframe", labelpad=1)
    panels[2].grid(True)
    panels[0].set_title(f"{title}\nellipses enlarged {scale:g} times")


def _draw_all(
    flights: Mapping[str, Curves], theirs: Curves | None, stem: Path, note: str, source: str
) -> None:
    """A column a flight, the paper's last and on grey."""
    shown = {**flights, **({"Paper (its MH)": theirs} if theirs else {})}
    grid = {"height_ratios": (1.0, 1.0, 0.6), "width_ratios": [_width(curves) for curves in shown.values()]}
    with new_figure(PAGE, 6.2, 3, len(shown), squeeze=False, gridspec_kw=grid) as (figure, panels):
        for column, (title, curves) in zip(panels.T, shown.items(), strict=True):
            _draw_flight(column, title, curves)
            if curves is theirs:
                for panel in column:
                    panel.set_facecolor(_PAPER_GROUND)
        for panel, label in zip(panels[:, 0], _ROWS, strict=True):
            panel.set_ylabel(label)
        looks = {
            label: line
            for panel in panels[:, 0]
            for line, label in zip(*panel.get_legend_handles_labels(), strict=True)
        }
        figure.legend(looks.values(), looks.keys(), loc="outside lower center", ncols=4)
        figure.supxlabel(note, fontsize=7)
        note_stand_in(figure, source == "rendered")
        save_figure(figure, stem)


def draw_ellipses(
    archive: Path, stem: Path, source: str, published: Path | None = None, beside: Sequence[Path] = ()
) -> None:
    """Draw flights, named as their archives of covariances; ``stem``.csv has centres and ellipses.

    ``beside``: archives of further sequences; ``published``: the paper's ellipses, in the last column. A
    sequence whose covariances are withheld is not drawn; the figure and the numbers say why.
    """
    flights: dict[str, Curves] = {}
    rows: list[dict[str, object]] = []
    withheld: dict[str, str] = {}
    for file in (archive, *beside):
        arrays = load_arrays(file)
        if str(arrays["withheld"]):
            withheld[file.stem] = str(arrays["withheld"])
            continue
        n = int(arrays["n_keyframes"])
        curves = {name: (arrays[f"p_W_{name}"], xy_ellipses(arrays[name], n)) for name in _LOOKS}
        flights[file.stem] = curves
        rows += [
            {
                "curve": name,
                "keyframe": k,
                "x_m": float(p[0]),
                "y_m": float(p[1]),
                **ellipse,
                "enlargement": _scale(curves),
                "source": source,
                "sequence": file.stem,
                "withheld": "",
            }
            for name, (p_W, ellipses) in curves.items()
            for k, (p, ellipse) in enumerate(zip(p_W, ellipses, strict=True))
        ]
    note = "; ".join(f"{name}: {why}" for name, why in withheld.items())
    if flights:
        theirs = {name: published_ellipses(published, name) for name in _LOOKS} if published else None
        text = "\n".join(textwrap.wrap(note and f"Covariance withheld. {note}.", 100))
        _draw_all(flights, theirs, stem, text, source)
    else:
        draw_withheld(stem, note, source == "rendered")
    columns = list(rows[0]) if rows else ["sequence", "withheld", "source"]
    rows += [
        {**dict.fromkeys(columns, ""), "sequence": name, "withheld": why, "source": source}
        for name, why in withheld.items()
    ]
    write_rows(f"{stem}.csv", rows)
