"""Errors of the keyframes against the sigmas that the covariance predicts, on the image sequences."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.ticker import LogLocator, NullLocator

from vigauge.files import write_rows
from vigauge.geometry import so3
from vigauge.geometry.so3 import Array
from vigauge.model.archive import load_arrays, load_states
from vigauge.model.evaluation import align_first_pose
from vigauge.model.state import State

from .style import COLUMN, OTHERS, draw_withheld, new_figure, note_stand_in, save_figure

_PANELS = {
    "p": ("position", "mm", 1e3),
    "phi": ("rotation", "deg", 180.0 / np.pi),
    "v": ("velocity", "mm/s", 1e3),
}
_LOOKS = tuple(zip(OTHERS, "os", strict=False))


def error_rows(name: str, arrays: Mapping[str, Array], truth: State) -> list[dict[str, object]]:
    """A row a keyframe and quantity (p m, phi rad, v m/s): length of the error, and its sigma.

    Both in the fixed gauge: errors after first-pose alignment, sigma the root of the trace of the
    keyframe's block of the covariance. The first keyframe is left out: its position and yaw are held.
    """
    n = truth.n_keyframes
    estimate = State.start(arrays["p_W_fixed"], arrays["R_WB_fixed"], arrays["v_W_fixed"], np.empty((0, 3)))
    aligned = align_first_pose(estimate, truth)
    errors = {
        "p": aligned.p_W - truth.p_W,
        "phi": so3.log(aligned.R_WB @ truth.R_WB.swapaxes(1, 2)),
        "v": aligned.v_W - truth.v_W,
    }
    sigmas = np.sqrt(np.diagonal(arrays["fixed"]).reshape(3, n, 3).sum(axis=2))
    return [
        {
            "sequence": name,
            "keyframe": k,
            "quantity": quantity,
            "error": float(np.linalg.norm(error[k])),
            "sigma": float(sigma[k]),
        }
        for (quantity, error), sigma in zip(errors.items(), sigmas, strict=True)
        for k in range(1, n)
    ]


def draw_errors(archives: Mapping[str, Path], truths: Mapping[str, Path], stem: Path, rendered: bool) -> None:
    """Three panels on logarithmic axes, a point a keyframe, and the line on which error and sigma are equal.

    A sequence whose covariance is withheld is left out; where all are, the figure says why.
    """
    rows: list[dict[str, object]] = []
    withheld = []
    for name, file in archives.items():
        arrays = load_arrays(file)
        if why := str(arrays["withheld"]):
            withheld.append(f"{name}: {why}")
        else:
            rows += error_rows(name, arrays, load_states(truths[name])[0])
    write_rows(f"{stem}.csv", rows or [{"withheld": "; ".join(withheld)}])
    if not rows:
        draw_withheld(stem, "; ".join(withheld), rendered)
        return
    table = pd.DataFrame(rows)
    with new_figure(COLUMN, 5.0, 3) as (figure, axes):
        for panel, (quantity, (title, unit, scale)) in zip(axes, _PANELS.items(), strict=True):
            for (name, part), (colour, marker) in zip(
                table[table["quantity"] == quantity].groupby("sequence"), _LOOKS, strict=False
            ):
                panel.loglog(
                    scale * part["sigma"],
                    scale * part["error"],
                    marker,
                    color=colour,
                    markerfacecolor="none",
                    label=str(name).replace("_", " "),
                )
            shown = table[table["quantity"] == quantity]
            ends = scale * np.array([shown["sigma"].min() / 1.3, shown["sigma"].max() * 1.3])
            panel.plot(ends, ends, "k--", label="error = sigma")
            panel.set_xlim(*ends)
            panel.set_xlabel(f"Predicted sigma of the {title} ({unit})")
            panel.set_ylabel(f"Error ({unit})")
            panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0)))
            panel.xaxis.set_minor_locator(NullLocator())
            for axis in (panel.xaxis, panel.yaxis):
                axis.set_major_formatter("{x:g}")
            panel.grid(True)
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
        note_stand_in(figure, rendered)
        save_figure(figure, stem)
