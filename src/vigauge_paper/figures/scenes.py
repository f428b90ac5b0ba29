"""Figure 3: two of the simulated scenes, trajectory and landmarks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.ticker import MaxNLocator

from vigauge.files import write_rows
from vigauge.model.archive import load_states

from .style import COLOURS, PAGE, new_figure, save_figure


def draw_scenes(titles: Sequence[str], truths: Sequence[Path], paths: Sequence[Path], stem: Path) -> None:
    """One 3-D panel a scene; ``stem``.csv has all points shown."""
    rows: list[dict[str, object]] = []
    with new_figure(PAGE, 3.1, 1, len(titles), subplot_kw={"projection": "3d"}) as (figure, axes):
        for panel, title, truth_file, path_file in zip(
            np.atleast_1d(axes), titles, truths, paths, strict=True
        ):
            truth = load_states(truth_file)[0]
            path = pd.read_csv(path_file)
            panel.scatter(*truth.X_W.T, s=6, color=COLOURS["prior"], depthshade=True, label="landmarks")
            panel.plot(path.x_m, path.y_m, path.z_m, color=COLOURS["fix"], linewidth=1.4, label="trajectory")
            panel.scatter(*truth.p_W.T, s=8, color=COLOURS["fix"], label="keyframes")
            panel.set_title(title)
            panel.set_xlabel("x (m)", labelpad=-6)
            panel.set_ylabel("y (m)", labelpad=-4)
            panel.set_zlabel("z (m)", labelpad=-8)
            panel.tick_params(pad=-2, labelsize=6)
            panel.set_aspect("equal")
            panel.set_box_aspect(None, zoom=0.95)
            for axis in (panel.xaxis, panel.yaxis, panel.zaxis):
                axis.set_major_locator(MaxNLocator(5, integer=True))
            panel.view_init(elev=22, azim=-70)
            for kind, points in (
                ("landmark", truth.X_W),
                ("keyframe", truth.p_W),
                ("trajectory", path.to_numpy()),
            ):
                rows += [
                    {"scene": title, "kind": kind, "x_m": float(x), "y_m": float(y), "z_m": float(z)}
                    for x, y, z in points
                ]
        np.atleast_1d(axes)[0].legend(loc="upper left", fontsize=6)
        save_figure(figure, stem)
    write_rows(f"{stem}.csv", rows)
