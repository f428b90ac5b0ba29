"""Figure 1: where the uncertainty of the positions lies in the free and in the fixed gauge.

Ellipses are those of the 2 x 2 covariance of (x, y), one standard deviation, all enlarged
alike. (The paper's have variances as axis lengths and no correlation.)
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse

from vigauge.files import write_rows
from vigauge.geometry.so3 import Array
from vigauge.model.archive import load_arrays

from .style import COLOURS, PAGE, PUBLISHED, draw_withheld, new_figure, note_stand_in, save_figure

# Share of the flight's extent that the largest ellipse may take.
_LARGEST_SHARE = 0.12


def xy_ellipses(covariance: Array, n_keyframes: int) -> list[dict[str, float]]:
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


def _draw(
    axes: Axes,
    p_W: Array,
    ellipses: list[dict[str, float]],
    scale: float,
    colour: str,
    label: str,
    style: str,
) -> None:
    axes.plot(p_W[:, 0], p_W[:, 1], style, color=colour, label=label)
    for centre, ellipse in zip(p_W, ellipses, strict=True):
        axes.add_patch(
            Ellipse(
                (centre[0], centre[1]),
                2 * scale * ellipse["semi_major_m"],
                2 * scale * ellipse["semi_minor_m"],
                angle=np.degrees(ellipse["angle_rad"]),
                fill=False,
                edgecolor=colour,
                linewidth=0.7,
                linestyle=style,
            )
        )


def _height(p_W: Array) -> float:
    """Height of the figure (inches) at which panels with equal axes fit the flight."""
    width, height = np.ptp(p_W[:, :2], axis=0)
    return float(np.clip(0.8 + 3.0 * height / max(width, 1e-9), 2.4, 4.2))


def published_ellipses(file: Path, curve: str) -> tuple[Array, list[dict[str, float]]]:
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


def _draw_published(panels: Sequence[Axes], file: Path) -> None:
    """The paper's two panels, enlarged to be as readable as ours."""
    curves = {name: published_ellipses(file, name) for name in ("free", "transformed", "fixed")}
    extent = float(np.ptp(curves["free"][0], axis=0).max())
    scale = enlargement(extent, max(e["semi_major_m"] for _, es in curves.values() for e in es))
    _draw(panels[0], *curves["free"], scale, PUBLISHED, "Paper, free", "-")
    _draw(panels[1], *curves["transformed"], scale, PUBLISHED, "Paper, transformed free", "-")
    _draw(panels[1], *curves["fixed"], scale, "#000000", "Paper, fixed", "--")
    for panel, title in zip(panels, ("(c) Paper, free gauge", "(d) Paper, gauge fixation"), strict=True):
        panel.set_aspect("equal", adjustable="box")  # a long flight: the whole of it is to be seen
        panel.set_xlabel("x (m)")
        panel.set_title(f"{title}; one sigma, enlarged {scale:g} times")
        panel.legend(loc="upper right")
    panels[0].set_ylabel("y (m)")


def draw_ellipses(archive: Path, stem: Path, source: str, published: Path | None = None) -> None:
    """Draw both panels from an archive of covariances; ``stem``.csv has centres and ellipses.

    ``published``: the paper's ellipses, drawn in a second row. Where the covariances are withheld, both
    of ours say why.
    """
    arrays = load_arrays(archive)
    withheld = str(arrays["withheld"])
    if withheld:
        write_rows(f"{stem}.csv", [{"withheld": withheld, "source": source}])
        draw_withheld(stem, withheld, source == "rendered")
        return
    n = int(arrays["n_keyframes"])
    curves = {
        name: (arrays[f"p_W_{name}"], xy_ellipses(arrays[name], n))
        for name in ("free", "transformed", "fixed")
    }
    extent = float(np.ptp(curves["free"][0][:, :2], axis=0).max())
    largest = max(e["semi_major_m"] for _, ellipses in curves.values() for e in ellipses)
    scale = enlargement(extent, largest)
    height = _height(curves["free"][0])
    rows = 1 if published is None else 2
    heights = [height, 1.7][:rows]
    grid = {"height_ratios": heights}
    with new_figure(PAGE, sum(heights), rows, 2, sharey="row", gridspec_kw=grid) as (figure, panels):
        axes = np.atleast_2d(panels)[0]
        if published is not None:
            _draw_published(panels[1], published)
        _draw(axes[0], *curves["free"], scale, COLOURS["free"], "Free", "-")
        _draw(axes[1], *curves["transformed"], scale, COLOURS["free"], "Transformed free", "-")
        _draw(axes[1], *curves["fixed"], scale, COLOURS["fix"], "Fixed", "--")
        for panel, title in zip(axes, ("(a) Free gauge", "(b) Gauge fixation"), strict=True):
            panel.set_aspect("equal", adjustable="datalim")
            panel.set_xlabel("x (m)")
            panel.set_title(f"{title}; one sigma, enlarged {scale:g} times")
            panel.legend()
        axes[0].set_ylabel("y (m)")
        note_stand_in(figure, source == "rendered")
        save_figure(figure, stem)
    write_rows(
        f"{stem}.csv",
        [
            {
                "curve": name,
                "keyframe": k,
                "x_m": float(p[0]),
                "y_m": float(p[1]),
                **ellipse,
                "enlargement": scale,
                "source": source,
            }
            for name, (p_W, ellipses) in curves.items()
            for k, (p, ellipse) in enumerate(zip(p_W, ellipses, strict=True))
        ],
    )
