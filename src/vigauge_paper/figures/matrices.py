"""Figures 9 and 10: the covariance in the free gauge, the same transformed by (12), and the fixed one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from vigauge.geometry.so3 import Array
from vigauge.model.archive import load_arrays, save_arrays

from ..experiments.exchange import exchanged, published_magnitude
from .style import PAGE, draw_withheld, new_figure, note_stand_in, save_figure

# Offset under the logarithm: magnitudes below it are white (Section VI-B).
EPSILON = 1e-7
HELD = "#F0E442"
PANELS = ("free", "transformed", "fixed")
_TITLES = ("(a) Free gauge", "(b) Transformed free gauge", "(c) Gauge fixation")
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


def sigma_ratio(ours: Array, paper: Array) -> Array:
    """(3,) root mean square sigma of position, rotation and velocity, ours over the paper's.

    The covariances may be of different numbers of keyframes.
    """
    mean = [np.diagonal(covariance).reshape(3, -1).mean(axis=1) for covariance in (ours, paper)]
    return np.sqrt(mean[0] / mean[1])


def _grey(axes: Axes, values: np.ma.MaskedArray, highest: float, title: str) -> AxesImage:
    """Values as grey levels up to ``highest``, white at epsilon; what is masked is held."""
    n = len(values) // 3
    grey = mpl.colormaps["gray_r"].with_extremes(bad=HELD)
    image = axes.imshow(values, cmap=grey, interpolation="nearest", vmin=np.log10(EPSILON), vmax=highest)
    places = [(k + 0.5) * n - 0.5 for k in range(3)]
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_ticks(places, [r"$\mathbf{p}$", r"$\phi$", r"$\mathbf{v}$"])
    axes.tick_params(length=0)
    axes.set_title(title)
    return image


def _shown(covariance: Array, held: NDArray[np.bool_]) -> np.ma.MaskedArray:
    return np.ma.masked_array(logarithm(covariance), held)


def _ours(arrays: Mapping[str, Array], name: str) -> np.ma.MaskedArray:
    """A panel of ours. Parameters that the fixed gauge holds are held, but in the free one."""
    held = held_entries(arrays["fixed"]) & (name != "free")
    return _shown(arrays[name], held[:, None] | held[None, :])


def _paper(arrays: Mapping[str, Array], name: str) -> np.ma.MaskedArray:
    """A panel of the paper's figure, drawn there with another epsilon."""
    held = arrays[f"{name}_zero_mask"].astype(bool) | np.isnan(arrays[name])
    return _shown(published_magnitude(arrays, name), held)


def _ratios(arrays: Mapping[str, Array], theirs: Mapping[str, Array]) -> Array:
    """(3, 3) sigma ratios, a row a panel.

    One variance of the printed fixed covariance stands beside its place: it is put back.
    """
    magnitudes = [published_magnitude(theirs, name) for name in PANELS]
    magnitudes[-1] = exchanged(magnitudes[-1])
    return np.array([sigma_ratio(arrays[name], m) for name, m in zip(PANELS, magnitudes, strict=True)])


def draw_covariances(archive: Path, stem: Path, source: str, published: Path | None = None) -> None:
    """Draw one comparison from an archive of covariances, and keep what is shown as ``stem``.npz.

    ``source`` is 'simulation', 'euroc' or 'rendered'; it is kept with the numbers. ``published``: archive
    of the paper's figure, drawn in a second row with the same epsilon and the same grey levels. Titles
    then give the ratio of the sigmas, ours over the paper's, kept as ``sigma_ratio_to_paper``, a row a panel.
    Where the covariances are withheld, the figure says why, and the archive too.
    """
    arrays = load_arrays(archive)
    withheld = str(arrays["withheld"])
    if withheld:
        save_arrays(f"{stem}.npz", {"withheld": arrays["withheld"], "source": np.array(source)})
        draw_withheld(stem, withheld, source == "rendered")
        return
    kept = {name: arrays[name] for name in _KEPT} | {"source": np.array(source)}
    rows, titles = [[_ours(arrays, name) for name in PANELS]], [list(_TITLES)]
    if published is not None:
        theirs = load_arrays(published)
        kept["sigma_ratio_to_paper"] = _ratios(arrays, theirs)
        for k, (p, phi, v) in enumerate(kept["sigma_ratio_to_paper"]):
            titles[0][k] += f"\n$\\sigma$ over paper's: p {p:.2f}, $\\phi$ {phi:.2f}, v {v:.2f}"
        rows.append([_paper(theirs, name) for name in PANELS])
        titles.append([f"({letter}) Paper, {name}" for letter, name in zip("def", PANELS, strict=True)])
    save_arrays(f"{stem}.npz", kept)
    with new_figure(PAGE, 2.6 * len(rows), len(rows), 3, squeeze=False) as (figure, axes):
        # The free covariance has another range than the two of the fixed gauge.
        for columns in ([0], [1, 2]):
            highest = max(float(row[k].max()) for row in rows for k in columns)
            for panels, row, names in zip(axes, rows, titles, strict=True):
                for k in columns:
                    image = _grey(panels[k], row[k], highest, names[k])
            bar = figure.colorbar(
                image,
                ax=axes[:, columns],
                location="bottom",
                fraction=0.03,
                pad=0.02,
                aspect=25 * len(columns),
            )
            bar.ax.tick_params(labelsize=7)
            bar.set_label(r"$\log_{10}(|\sigma_{ij}| + 10^{-7})$, in m, rad, m/s")
        same, converged = (
            float(arrays[f"relative_frobenius_{kind}"]) for kind in ("same_point", "converged")
        )
        axes[0, 1].set_xlabel(
            rf"$\|\Sigma_b-\Sigma_c\|_F/\|\Sigma_c\|_F$: {100 * converged:.2g} % between estimates, "
            f"{same:.0e} at one point",
            fontsize=7,
        )
        note_stand_in(figure, source == "rendered")
        save_figure(figure, stem)
