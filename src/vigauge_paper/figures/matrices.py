"""Figures 9 and 10: the covariance in the free gauge, the same transformed by (12), and the fixed one."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vigauge.geometry.so3 import Array
from vigauge.model.archive import load_arrays, save_arrays

from .style import PAGE, draw_withheld, new_figure, note_stand_in, save_figure

# Offset under the logarithm: magnitudes below it are white (Section VI-B).
EPSILON = 1e-7
HELD = "#F0E442"
_KEPT = (
    "free",
    "transformed",
    "fixed",
    "relative_frobenius_same_point",
    "relative_frobenius_converged",
    "n_keyframes",
    "n_landmarks",
)


def logarithm(covariance: Array) -> Array:
    """log10(|sigma| + epsilon) of every entry (Section VI-B)."""
    return np.log10(np.abs(covariance) + EPSILON)


def held_entries(covariance: Array) -> NDArray[np.bool_]:
    """(n,) whether a parameter is held: its variance is zero next to the others, up to rounding."""
    variance = np.diagonal(covariance)
    return variance <= 1e-9 * np.median(variance)


def _show(figure: Figure, axes: Axes, covariance: Array, held: NDArray[np.bool_], title: str) -> None:
    values = np.ma.masked_array(logarithm(covariance), held[:, None] | held[None, :])
    _grey(figure, axes, values, len(covariance) // 3, np.log10(EPSILON), title)


def _grey(figure: Figure, axes: Axes, values: np.ma.MaskedArray, n: int, lowest: float, title: str) -> None:
    """Values as grey levels from ``lowest`` up, in blocks of ``n``; what is masked is held."""
    grey = mpl.colormaps["gray_r"].with_extremes(bad=HELD)
    image = axes.imshow(values, cmap=grey, interpolation="nearest", vmin=lowest)
    # One bar a panel: the free covariance has another range.
    bar = figure.colorbar(image, ax=axes, shrink=0.8, pad=0.03)
    bar.ax.tick_params(labelsize=6)
    places = [(k + 0.5) * n - 0.5 for k in range(3)]
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_ticks(places, [r"$\mathbf{p}$", r"$\phi$", r"$\mathbf{v}$"])
    axes.tick_params(length=0)
    axes.set_title(title)


def _show_published(figure: Figure, axes: Axes, arrays: dict[str, Array], panel: str, title: str) -> None:
    """A panel of the paper's figure: its own range, since its offset under the logarithm is another."""
    n = len(arrays[panel]) // 3
    held = arrays[f"{panel}_zero_mask"].astype(bool) | np.isnan(arrays[panel])
    _grey(figure, axes, np.ma.masked_array(arrays[panel], held), n, np.log10(float(arrays["eps"])), title)


def draw_covariances(archive: Path, stem: Path, source: str, published: Path | None = None) -> None:
    """Draw one comparison from an archive of covariances, and keep what is shown as ``stem``.npz.

    ``source`` is 'simulation', 'euroc' or 'rendered'; it is kept with the numbers. ``published``: archive
    of the paper's figure, drawn in a second row. Where the covariances are withheld, the
    figure says why, and the archive too.
    """
    arrays = load_arrays(archive)
    withheld = str(arrays["withheld"])
    if withheld:
        save_arrays(f"{stem}.npz", {"withheld": arrays["withheld"], "source": np.array(source)})
        draw_withheld(stem, withheld, source == "rendered")
        return
    save_arrays(f"{stem}.npz", {name: arrays[name] for name in _KEPT} | {"source": np.array(source)})
    held = held_entries(arrays["fixed"])
    none = np.zeros(len(held), dtype=bool)
    theirs = None if published is None else load_arrays(published)
    rows = 1 if theirs is None else 2
    with new_figure(PAGE, 2.45 * rows, rows, 3) as (figure, panels):
        axes = np.atleast_2d(panels)[0]
        if theirs is not None:
            for panel, name, title in zip(panels[1], ("free", "transformed", "fixed"), "def", strict=True):
                _show_published(figure, panel, theirs, name, f"({title}) Paper, {name}")
        _show(figure, axes[0], arrays["free"], none, "(a) Free gauge")
        _show(figure, axes[1], arrays["transformed"], held, "(b) Transformed free gauge")
        _show(figure, axes[2], arrays["fixed"], held, "(c) Gauge fixation")
        same, converged = (
            float(arrays[f"relative_frobenius_{kind}"]) for kind in ("same_point", "converged")
        )
        axes[1].set_xlabel(
            rf"$\|\Sigma_b-\Sigma_c\|_F/\|\Sigma_c\|_F$: {100 * converged:.2g} % between estimates, "
            f"{same:.0e} at one point",
            fontsize=6.5,
        )
        note_stand_in(figure, source == "rendered")
        save_figure(figure, stem)
