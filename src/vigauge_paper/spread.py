"""By how much results on a sequence move under harmless changes of the front-end."""

from collections.abc import Sequence

import pandas as pd

from .ids import ERRORS, FIX, FREE, GAUGES, HEADLINE, Row

# What a reader is shown: name, scale, unit.
_SHOWN = {
    "p_rmse_m": ("p", 1e3, "mm"),
    "phi_rmse_deg": ("phi", 1.0, "deg"),
    "v_rmse_mps": ("v", 1e3, "mm/s"),
    "start_p_rmse_m": ("start p", 1e3, "mm"),
}
QUANTITIES = (*ERRORS, *(f"start_{error}" for error in ERRORS), "iterations")


def spread_rows(sequence: str, solutions: Sequence[pd.DataFrame]) -> list[Row]:
    """A row a gauge and quantity: median, least and greatest over the changed forms of a sequence.

    ``solutions`` as solve writes them, one a form. ``gauge_difference`` is the greatest
    |ratio to fixation - 1| within one form, and ``below_fixation`` counts the forms in which the gauge has
    less. Runs that did not converge are not among the ``runs``.
    """
    table = pd.concat(list(solutions), keys=range(len(solutions)), names=["form", None]).reset_index("form")
    table = table[(table["noise"] == HEADLINE) & table["converged"]]
    fixed = table[table["gauge"] == FIX].set_index("form")
    rows: list[Row] = []
    for gauge in GAUGES:
        mine = table[table["gauge"] == gauge].set_index("form")
        for quantity in QUANTITIES:
            values = mine[quantity]
            rows.append(
                {
                    "sequence": sequence,
                    "gauge": gauge,
                    "quantity": quantity,
                    "runs": len(values),
                    "median": float(values.median()),
                    "least": float(values.min()),
                    "greatest": float(values.max()),
                    "gauge_difference": float((values / fixed[quantity] - 1.0).abs().max()),
                    "below_fixation": int((values < fixed[quantity].reindex(values.index)).sum()),
                }
            )
    return rows


def spread_sentence(table: pd.DataFrame) -> str:
    """The note of Table III: median and range of errors, starts, iterations; and what the gauge changes."""
    parts = []
    for sequence in table["sequence"].unique():
        mine = table[table["sequence"] == sequence].set_index(["gauge", "quantity"])
        shown = [
            f"{name} {_range(mine.loc[(FIX, q)], scale)} {unit}" for q, (name, scale, unit) in _SHOWN.items()
        ]
        counts = [f"{gauge} iterations {_range(mine.loc[(gauge, 'iterations')])}" for gauge in (FIX, FREE)]
        counts.append(f"fewer under free in {mine.loc[(FREE, 'iterations'), 'below_fixation']} runs")
        parts.append(f"{sequence} ({int(mine['runs'].min())} runs): {', '.join([*shown, *counts])}")
    optimum = table[table["quantity"].isin(ERRORS) & (table["gauge"] == FREE)]
    gauge = optimum["gauge_difference"].max()
    width = ((optimum["greatest"] - optimum["least"]) / optimum["median"]).min()
    below = "far below that spread" if gauge < 0.1 * width else "not far below that spread"
    return (
        f"Over harmless changes of the front-end, median (range): {'; '.join(parts)}. "
        f"The difference between free and fixation, at most {100 * gauge:.2g} %, is {below}, "
        f"at least {100 * width:.2g} %."
    )


def spread_table(table: pd.DataFrame) -> list[Row]:
    """Median (range) as a reader wants them: a row a sequence and gauge."""
    rows: list[Row] = []
    for (sequence, gauge), mine in table.groupby(["sequence", "gauge"], sort=False):
        found = mine.set_index("quantity")
        shown = {f"{name} ({unit})": _range(found.loc[q], scale) for q, (name, scale, unit) in _SHOWN.items()}
        about: Row = {"sequence": sequence, "gauge": gauge, "runs": int(mine["runs"].min())}
        rows.append({**about, **shown, "iterations": _range(found.loc["iterations"])})
    return rows


def _range(row: pd.Series, scale: float = 1.0) -> str:
    """Median (least to greatest), two digits."""
    low, middle, high = (f"{float(f'{scale * row[key]:.2g}'):g}" for key in ("least", "median", "greatest"))
    return f"{middle} ({low} to {high})"
