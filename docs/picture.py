"""The picture of README.md: one estimate, and how sure its positions are in four gauges.

python -m docs.picture    # rewrites docs/gauges.png
"""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

import vigauge as vg

GAUGES = {
    "fixed: the first pose has no error": vg.FixedGauge(),
    "keyframe 5 has no error": vg.KeyframeGauge(5),
    "centroid: the centre has no error": vg.CentroidGauge(),
    "free: no pose is held": vg.FreeGauge(),
}


def draw(path: Path) -> None:
    matplotlib.use("agg")
    from matplotlib import pyplot as plt

    problem = vg.example_problem()
    covariance = vg.Covariance.of(problem, vg.solve(problem, vg.FreeGauge()).state)
    figure, axes = plt.subplots(figsize=(7.2, 3.0), layout="constrained")
    for (label, gauge), style in zip(GAUGES.items(), ("o-", "s-", "^-", "v--"), strict=True):
        position = covariance.keyframes(gauge)[:, :3, :3]
        sigma_mm = 1e3 * np.sqrt(np.trace(position, axis1=1, axis2=2))
        axes.plot(sigma_mm, style, label=label, markersize=4)
    axes.set(xlabel="keyframe", ylabel="sigma of its position, mm", ylim=(0, None))
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small", frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    draw(Path(__file__).with_name("gauges.png"))
