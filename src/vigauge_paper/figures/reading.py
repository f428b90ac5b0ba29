"""What a prior's weight multiplies: the pull of the first step against the weight, paper and ours."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from vigauge.files import write_rows

from ..experiments.reading import PAPER, slopes
from ..prior import INFORMATION, MEANING, RESIDUAL
from .style import PAGE, PUBLISHED, READING_COLOURS, new_figure, save_figure

_LINES = {
    RESIDUAL: (f"ours, weight {MEANING[RESIDUAL]}", READING_COLOURS[RESIDUAL], "s", "--"),
    INFORMATION: (f"ours, weight {MEANING[INFORMATION]}", READING_COLOURS[INFORMATION], "^", ":"),
    PAPER: ("paper's Fig. 6", PUBLISHED, "o", "-"),
}
_PANELS = {"position_m": "Position", "yaw_rad": "Yaw"}


def draw_reading(pulls: Path, stem: Path) -> None:
    """1 / r - 1 over the weight on logarithmic axes, with the slope of each line; r is the prior error after
    one step over that of the free gauge. A line of fewer than two weights has no slope.
    """
    table = pd.read_csv(pulls)
    slope = slopes(table)
    with new_figure(PAGE, 3.0, 1, 2, sharey=True) as (figure, axes):
        for panel, (quantity, title) in zip(axes, _PANELS.items(), strict=True):
            for source, (label, colour, marker, style) in _LINES.items():
                part = table[(table["source"] == source) & (table["quantity"] == quantity)]
                part = part.sort_values("weight")
                found = slope.get((source, quantity))
                text = label if found is None else f"{label}: slope {found:.2f}"
                panel.loglog(
                    part["weight"], part["pull"], color=colour, marker=marker, linestyle=style, label=text
                )
            panel.set_title(title)
            panel.set_xlabel("Prior weight $w^P$")
            panel.grid(True)
            panel.legend(loc="upper left")
        # Room for the legends, above all lines.
        axes[0].set_ylim(top=1e6 * table["pull"].max())
        axes[0].set_ylabel("Pull of the prior in the first step, $1/r - 1$")
        save_figure(figure, stem)
    write_rows(
        f"{stem}.csv",
        [{**row, "slope": slope.get((row["source"], row["quantity"]))} for row in table.to_dict("records")],
    )
