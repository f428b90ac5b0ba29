"""A figure of two columns for a narrow screen: its panels below each other, at the width of one column."""

from __future__ import annotations

import textwrap

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec

# Widths in inches: of what stands left and right of a panel; of characters of a note of 7 points.
_BESIDE = 0.7
_CHARACTER = 0.062


def stack(figure: Figure, width: float) -> None:
    """Move the panels of a drawn figure into one column of ``width`` inches, column after column.

    A panel keeps its height, or its shape where that means something. Labels of axes that it shared with its
    row or column are repeated, as the panel that had them is no longer beside it.
    """
    if figure.get_figwidth() <= width:
        return
    figure.draw_without_rendering()
    panels = {(s.colspan.start, s.rowspan.start): a for a in figure.axes if (s := a.get_subplotspec())}
    heights = [_height(panels[place], width - _BESIDE) for place in sorted(panels)]
    rows = 1 + max(row for _, row in panels)
    drawn = sum(_height(axes) for (column, _), axes in panels.items() if column == 0)
    around = (figure.get_figheight() - drawn) / rows
    several = len(panels) > rows
    grid = GridSpec(len(panels), 1, figure, height_ratios=heights)
    for number, (column, row) in enumerate(sorted(panels)):
        axes = panels[column, row]
        axes.set_subplotspec(grid[number])
        if several:
            _label(axes, panels.get((0, row), axes), panels.get((column, rows - 1), axes))
    figure.set_size_inches(width, sum(heights) + len(panels) * around)
    named = {
        label: handle
        for axes in panels.values()
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    for legend in list(figure.legends):
        texts = [text.get_text() for text in legend.get_texts()]
        figure.legend([named[text] for text in texts], texts, loc="outside lower center", ncols=2)
        legend.remove()
    if note := figure.get_supxlabel():
        figure.supxlabel(textwrap.fill(note, int(width / _CHARACTER)))
    # A first layout finds the widths, from which a second one has the heights of panels of fixed shape.
    figure.draw_without_rendering()


def _height(axes: Axes, width: float | None = None) -> float:
    """Height of a panel in inches; at another ``width`` where a unit is as long in x as in y."""
    box = axes.get_window_extent().transformed(axes.figure.dpi_scale_trans.inverted())
    return float(
        box.height if width is None or axes.get_aspect() == "auto" else box.height * width / box.width
    )


def _label(axes: Axes, first_of_row: Axes, last_of_column: Axes) -> None:
    """Labels and ticks that the panel left to the first of its row and the last of its column."""
    axes.set_ylabel(axes.get_ylabel() or first_of_row.get_ylabel())
    axes.set_xlabel(axes.get_xlabel() or last_of_column.get_xlabel())
    axes.tick_params(labelleft=True, labelbottom=True)
