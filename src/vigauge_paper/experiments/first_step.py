"""How hard the damping holds the orbit, read off the first step of a run.

Along the orbit the cost is flat, so the first step is cut by the prior alone: of the free
gauge's way a share s / (s + w) is left, where s is the damping in the units of the weight w.
"""

from __future__ import annotations

import pandas as pd

Row = dict[str, object]


def damping_weight(with_prior: float, free: float, weight: float) -> float:
    """s from the position errors after the first step with a prior and without; nan where it did nothing."""
    return weight * with_prior / (free - with_prior) if free > with_prior else float("nan")


def from_traces(name: str, trace: pd.DataFrame, labels: dict[str, float], column: str) -> list[Row]:
    """Median over trials of s; ``labels`` maps entries of ``column`` to their prior weights."""
    first = trace[trace["iteration"] == 1].pivot(index="trial", columns=column, values="prior_position_m")
    rows: list[Row] = []
    for label, weight in labels.items():
        values = [damping_weight(a, b, weight) for a, b in zip(first[label], first["free"], strict=True)]
        rows.append(
            {"experiment": name, "weight": weight, "damping_weight": float(pd.Series(values).median())}
        )
    return rows


def from_published(name: str, figure6: pd.DataFrame) -> list[Row]:
    """The same from the points of the paper's Fig. 6."""
    first = figure6.query("panel == 'position_m' and step == 1").set_index("weight")["prior_error"]
    return [
        {
            "experiment": name,
            "weight": float(weight),
            "damping_weight": damping_weight(float(error), float(first["free"]), float(weight)),
        }
        for weight, error in first.items()
        if weight != "free"
    ]
