"""What the paper's figures say of the prior's weight: iterations at powers of it."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from vigauge.model.problem import Problem
from vigauge.solver.levenberg_marquardt import Options
from vigauge_paper.experiments.interleaved import Row
from vigauge_paper.experiments.solves import plateau


def squared_weights(
    published: Path, problems: list[Problem], solver: Options, powers: tuple[int, ...] = (1, 2)
) -> list[Row]:
    """Iterations at powers of the weights of the paper's Fig. 5, beside the published medians.

    In Fig. 6 the prior error after one step falls as 1 / w^2: the weights shown there multiply
    the residual of Eq. (11), so that w^P is their square.
    """
    figure5 = pd.read_csv(published / "fig05_prior_weight_cost.csv").query("quantity == 'iterations'")
    medians = dict(zip(figure5["weight"], figure5["median"], strict=True))
    rows: list[Row] = []
    for weight, median in medians.items():
        for power in powers:
            weight_used = f"{float(weight) ** power:g}"
            rows += [
                {"label": f"{weight:g}", "power": power, "published_median": median, **row}
                for row in plateau(problems, [weight_used], {"as configured": solver})
            ]
    return rows
