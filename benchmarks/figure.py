"""The log-log figure of scaling.csv: time of an iteration against observations, and the machine's floor."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from vigauge_paper.figures.style import COLUMN, new_figure, save_pictures

from .results import Row

_LOOK = {
    "vigauge": ("#D55E00", "s"),
    "ceres": ("#0072B2", "o"),
    "gtsam": ("#009E73", "^"),
    "scipy": ("#8C8C8C", "v"),
}
_NAMES = {"vigauge": "vigauge", "ceres": "Ceres", "gtsam": "GTSAM", "scipy": "SciPy"}


def draw_scaling(rows: Sequence[Row], stem: Path) -> None:
    """``stem``.pdf and .png; one thread. The exponents in the legend are those of the rows."""
    with new_figure(COLUMN, 2.9) as (figure, axes):
        single = [row for row in rows if row["threads"] == 1]
        for solver in dict.fromkeys(str(row["solver"]) for row in single):
            mine = sorted(
                (row for row in single if row["solver"] == solver),
                key=lambda row: int(str(row["n_observations"])),
            )
            colour, marker = _LOOK[solver]
            slope = mine[0]["exponent_observations"]
            label = _NAMES[solver] + ("" if slope == "" else f", $M^{{{float(str(slope)):.2f}}}$")
            axes.loglog(
                [int(str(row["n_observations"])) for row in mine],
                [float(str(row["ms_per_iteration"])) for row in mine],
                color=colour,
                marker=marker,
                label=label,
            )
        floor = {int(str(row["n_observations"])): float(str(row["floor_ms"])) for row in single}
        axes.loglog(
            sorted(floor), [floor[n] for n in sorted(floor)], "k--", lw=0.8, label="floor of the machine"
        )
        axes.set_xlabel("observations $M$ (10 to 1000 keyframes)")
        axes.set_ylabel("time of an iteration (ms)")
        axes.grid(which="both")
        # Below all lines, where there is room.
        axes.set_ylim(bottom=0.2 * min(floor.values()))
        axes.legend(loc="lower right")
        save_pictures(figure, stem)
