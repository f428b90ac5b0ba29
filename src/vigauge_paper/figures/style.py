"""One look for all figures: sizes of the journal's columns, colours that colour-blind eyes tell apart.

Files are the same bytes for the same data: no dates, no program names in their metadata.
"""

from __future__ import annotations

import os
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vigauge.files import atomic_path

from ..ids import STAND_IN
from ..prior import INFORMATION, RESIDUAL
from .narrow import stack

# Width of one and of two columns, inches.
COLUMN = 3.5
PAGE = 7.16

# A colour a gauge, everywhere: Okabe and Ito's palette, nearest to the paper's blue, red and green.
COLOURS = {
    "fix": "#0072B2",
    "free": "#D55E00",
    "prior": "#009E73",
    "keyframe": "#CC79A7",
    "centroid": "#E69F00",
}
# The prior under four weights, from weak to strong: its green, lighter and darker.
PRIOR_SHADES = ("#52BF9C", "#009E73", "#005A42", "#00261B")
# What is no gauge: readings of a weight, sequences, planes of a scene. The first ones stand alone.
OTHERS = ("#5D3A9B", "#999933", "#882255", "#88CCEE", "#555555")
READING_COLOURS = dict(zip((RESIDUAL, INFORMATION), OTHERS, strict=False))
MARKERS = {"fix": "o", "free": "s", "prior": "^"}
LABELS = {"fix": "Fix", "free": "Free", "prior": "Prior"}
PUBLISHED = "#8C8C8C"

_STYLE = {
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "axes.linewidth": 0.6,
    "grid.linewidth": 0.4,
    "grid.alpha": 0.5,
    "lines.linewidth": 1.0,
    "lines.markersize": 3.5,
    "pdf.fonttype": 42,
    "savefig.dpi": 200,
}


@contextmanager
def new_figure(
    width: float, height: float, rows: int = 1, columns: int = 1, **options: Any
) -> Iterator[tuple[Figure, Any]]:
    """A figure of the given size in inches in the common style, closed at the end of the block."""
    with mpl.rc_context(_STYLE):
        figure, axes = plt.subplots(rows, columns, figsize=(width, height), layout="constrained", **options)
        try:
            yield figure, axes
        finally:
            plt.close(figure)


def save_pictures(figure: Figure, stem: str | os.PathLike[str]) -> None:
    """Write ``stem``.pdf and ``stem``.png, each all or nothing."""
    _write(figure, Path(f"{stem}.pdf"), {"CreationDate": None, "Producer": None, "Creator": None})
    _write(figure, Path(f"{stem}.png"), {"Software": None})


def save_figure(figure: Figure, stem: str | os.PathLike[str]) -> None:
    """As :func:`save_pictures`, and of one column the :func:`narrow` PNG; the figure is then of one."""
    save_pictures(figure, stem)
    stack(figure, COLUMN)
    _write(figure, narrow(Path(f"{stem}.png")), {"Software": None})


def narrow(png: Path) -> Path:
    """Where the PNG of a figure stands whose panels are stacked for a phone."""
    return png.parent / "narrow" / png.name


def _write(figure: Figure, file: Path, metadata: dict[str, None]) -> None:
    with atomic_path(file) as temporary:
        figure.savefig(temporary, metadata=metadata)


def draw_withheld(stem: str | os.PathLike[str], why: str, rendered: bool) -> None:
    """Write a figure that has no numbers to show, and says why."""
    with new_figure(COLUMN, 1.6) as (figure, axes):
        axes.set_axis_off()
        text = textwrap.fill(f"Covariance withheld. {why}.", 55)
        axes.text(0.5, 0.5, text, ha="center", va="center", fontsize=8, transform=axes.transAxes)
        note_stand_in(figure, rendered)
        save_figure(figure, stem)


def note_stand_in(figure: Figure, rendered: bool) -> None:
    """Say on the figure itself that its data are not EuRoC's."""
    if rendered:
        figure.suptitle(STAND_IN, fontsize=8, fontweight="bold")


def box_plot(
    axes: Axes, statistics: list[dict[str, Any]], positions: list[float], width: float, colour: str
) -> None:
    """Boxes from statistics (med, q1, q3, whislo, whishi) in one colour."""
    line = {"color": colour, "linewidth": 0.9}
    axes.bxp(
        statistics,
        positions=positions,
        widths=width,
        showfliers=False,
        manage_ticks=False,
        boxprops=line,
        whiskerprops=line,
        capprops=line,
        medianprops=line,
    )
