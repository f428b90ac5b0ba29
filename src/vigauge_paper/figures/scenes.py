"""Figure 3: two of the simulated scenes, trajectory, landmarks, and the planes that these lie on."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.ticker import MaxNLocator

from vigauge.files import write_rows
from vigauge.geometry.so3 import Array
from vigauge.model.archive import load_states
from vigauge.synthetic.landmarks import PLANES

from .style import OTHERS, PAGE, new_figure, save_figure

_LAYOUT_ON_PLANES = "plane"
_LANDMARKS = "#555555"


def plane_patches(X_W: Array) -> dict[int, tuple[Array, np.ndarray]]:
    """By plane: corners (4, 3) of the rectangle that its landmarks span on it, and their rows in X_W."""
    normals = np.array([normal for normal, _ in PLANES])
    offsets = np.array([offset for _, offset in PLANES])
    nearest = np.argmin(np.abs(X_W @ normals.T - offsets), axis=1)
    patches: dict[int, tuple[Array, np.ndarray]] = {}
    for plane in np.unique(nearest):
        rows = np.flatnonzero(nearest == plane)
        across = int(np.argmax(np.abs(normals[plane])))
        a, b = (axis for axis in range(3) if axis != across)
        low, high = X_W[rows].min(axis=0), X_W[rows].max(axis=0)
        corners = np.full((4, 3), offsets[plane] / normals[plane][across])
        corners[:, a] = low[a], high[a], high[a], low[a]
        corners[:, b] = low[b], low[b], high[b], high[b]
        patches[int(plane)] = (corners, rows)
    return patches


def _draw_landmarks(panel: Any, X_W: Array, on_planes: bool) -> None:
    if not on_planes:
        panel.scatter(*X_W.T, s=5, color=_LANDMARKS, linewidth=0, clip_on=False, label="landmarks")
        return
    for number, (plane, (corners, rows)) in enumerate(plane_patches(X_W).items()):
        label = "_" if number else "landmarks"  # a colour a plane, one entry of the legend
        colour = OTHERS[plane]
        sides = corners[[[0, 1], [3, 2]]].transpose(2, 0, 1)
        panel.plot_surface(*sides, color=colour, edgecolor=colour, alpha=0.2, shade=False, clip_on=False)
        panel.scatter(*X_W[rows].T, s=5, color=colour, linewidth=0, clip_on=False, label=label)


def draw_scenes(titles: Sequence[str], truths: Sequence[Path], paths: Sequence[Path], stem: Path) -> None:
    """One 3-D panel a scene, whose title ends in its layout; ``stem``.csv has all points shown."""
    rows: list[dict[str, object]] = []
    with new_figure(PAGE, 3.2, 1, len(titles), subplot_kw={"projection": "3d"}) as (figure, axes):
        for panel, title, truth_file, path_file in zip(
            np.atleast_1d(axes), titles, truths, paths, strict=True
        ):
            truth = load_states(truth_file)[0]
            path = pd.read_csv(path_file)
            _draw_landmarks(panel, truth.X_W, title.endswith(_LAYOUT_ON_PLANES))
            panel.plot(path.x_m, path.y_m, path.z_m, color="black", linewidth=1.4, label="trajectory")
            panel.scatter(*truth.p_W.T, s=10, color="black", depthshade=False, label="keyframes")
            panel.set_title(title)
            panel.set_xlabel("x (m)", labelpad=-6)
            panel.set_ylabel("y (m)", labelpad=-4)
            panel.zaxis.set_rotate_label(False)  # else upside down on the left
            panel.set_zlabel("z (m)", labelpad=-8, rotation=90)
            panel.tick_params(pad=-2, labelsize=6.5)
            panel.set_aspect("equal")
            panel.set_box_aspect(None, zoom=1.3)
            for axis in (panel.xaxis, panel.yaxis, panel.zaxis):
                axis.set_major_locator(MaxNLocator(5, integer=True))
            panel.view_init(elev=24, azim=-122)
            for kind, points in (
                ("landmark", truth.X_W),
                ("keyframe", truth.p_W),
                ("trajectory", path.to_numpy()),
            ):
                rows += [
                    {"scene": title, "kind": kind, "x_m": float(x), "y_m": float(y), "z_m": float(z)}
                    for x, y, z in points
                ]
        figure.legend(
            *np.atleast_1d(axes)[0].get_legend_handles_labels(), loc="outside lower center", ncols=3
        )
        save_figure(figure, stem)
    write_rows(f"{stem}.csv", rows)
