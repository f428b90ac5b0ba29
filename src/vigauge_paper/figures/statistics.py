"""Numbers behind box plots and means. Runs that did not converge are counted, never averaged in."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import binom

from ..experiments.timing import paired_ratios


def box(values: np.ndarray) -> dict[str, Any]:
    """Quartiles, and whiskers at the last data within 1.5 interquartile ranges (as the paper's boxes).

    All NaN where there are no values: such a box is not drawn.
    """
    if not len(values):
        return dict.fromkeys(("whislo", "q1", "med", "q3", "whishi"), float("nan"))
    q1, median, q3 = np.percentile(values, [25, 50, 75])
    reach = 1.5 * (q3 - q1)
    inside = values[(values >= q1 - reach) & (values <= q3 + reach)]
    return {"whislo": float(inside.min()), "q1": q1, "med": median, "q3": q3, "whishi": float(inside.max())}


def box_row(values: np.ndarray, **labels: object) -> dict[str, object]:
    """One row of a table of box statistics, with the labels before."""
    b = box(values)
    return {
        **labels,
        "whisker_low": b["whislo"],
        "q1": float(b["q1"]),
        "median": float(b["med"]),
        "q3": float(b["q3"]),
        "whisker_high": b["whishi"],
        "count": len(values),
    }


def median_interval(values: np.ndarray) -> tuple[float, float]:
    """Two of the values between which the median of what they are drawn from lies, with 95 % probability.

    The whole range for fewer than six values, which cannot say as much; NaN where there are none.
    """
    if not len(values):
        return float("nan"), float("nan")
    ordered = np.sort(values)
    place = max(int(binom.ppf(0.025, len(values), 0.5)) - 1, 0)
    return float(ordered[place]), float(ordered[-1 - place])


def from_row(row: pd.Series) -> dict[str, Any]:
    """Box statistics, as Matplotlib wants them, from a row of such a table."""
    names = {"whislo": "whisker_low", "q1": "q1", "med": "median", "q3": "q3", "whishi": "whisker_high"}
    return {ours: float(row[theirs]) for ours, theirs in names.items()}


def converged_only(solutions: pd.DataFrame) -> tuple[pd.DataFrame, int]:
    """Rows that converged, and how many did not."""
    good = solutions[solutions["converged"]]
    return good, len(solutions) - len(good)


def time_per_iteration_ratios(
    timing: pd.DataFrame, label: str = "gauge", reference: str = "fix"
) -> dict[str, np.ndarray]:
    """Time per iteration over the reference's, paired by trial; one array a gauge.

    Pairs in which a run is missing are left out.
    """
    table = paired_ratios(timing, label, reference, each=True)
    return {name: table[name].to_numpy() for name in table.columns}
