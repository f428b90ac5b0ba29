"""What the paper's figures say of the prior's weight: iterations at powers of it."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from vigauge.model.problem import Problem
from vigauge.solver.levenberg_marquardt import Options

from .evidence import Evidence
from .experiment import Experiment, Material, Row, Trials
from .plateau import plateau


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


def rows(material: Material, settings: Trials) -> list[Row]:
    """The weights and their squares, on the configuration of the sweep."""
    problems = material.trials(material.sweep_configuration, settings.trials)
    return squared_weights(material.published, problems, material.solver)


def sentence(e: Evidence) -> str:
    """Our iterations at the squared weights against the published medians."""
    table = e.reason("squared")
    means = table.groupby(["label", "power"], sort=False)["iterations"].mean().unstack()
    medians = table.groupby("label", sort=False)["published_median"].first()
    shown = [
        f"{label}: {medians[label]:g} / {means.loc[label, 2]:.1f} (unsquared {means.loc[label, 1]:.1f})"
        for label in means.index
    ]
    counts = f"{', '.join(shown)}{e.left_out('squared')}"
    return f"Iterations, paper / ours at the squared weight: {counts}"


EXPERIMENT = Experiment("squared", rows, Trials)
