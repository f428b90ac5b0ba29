"""The pictures in docs: README's, of one estimate's sigmas in four gauges, and the tutorial's.

python -m docs.picture    # rewrites docs/*.png; `make docs` does so too
"""

from __future__ import annotations

from contextlib import chdir
from pathlib import Path

import matplotlib
import numpy as np

import vigauge as vg
from docs import pages
from vigauge_paper.figures.style import COLOURS

# What is held, its gauge, and its line: the three of the paper in the colours of its figures.
GAUGES = (
    ("fixed: position and heading of the first", vg.FixedGauge(), "o-", COLOURS["fix"]),
    ("keyframe 5: its position and heading", vg.KeyframeGauge(5), "s-", COLOURS["keyframe"]),
    ("centroid: mean position and heading", vg.CentroidGauge(), "^-", COLOURS["centroid"]),
    ("free: nothing is held", vg.FreeGauge(), "v--", COLOURS["free"]),
)


def draw(path: Path) -> None:
    """README's picture."""
    matplotlib.use("agg")
    from matplotlib import pyplot as plt

    problem = vg.example_problem()
    covariance = vg.Covariance.of(problem, vg.solve(problem, vg.FreeGauge()).state)
    figure, axes = plt.subplots(figsize=(7.2, 3.0), layout="constrained")
    for label, gauge, style, colour in GAUGES:
        position = covariance.keyframes(gauge)[:, :3, :3]
        sigma_mm = 1e3 * np.sqrt(np.trace(position, axis1=1, axis2=2))
        axes.plot(sigma_mm, style, color=colour, label=label, markersize=4)
    axes.set(xlabel="keyframe", ylabel="sigma of its position, mm", ylim=(0, None))
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small", frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    draw(pages.DOCS / "gauges.png")
    with chdir(pages.DOCS):  # the tutorial's own blocks draw its pictures
        for _ in pages.run(pages.DOCS / "tutorial.md"):
            pass
