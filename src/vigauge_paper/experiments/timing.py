"""Times of solves compared in pairs: the same trial and repeat, under two gauges or weights."""

from __future__ import annotations

import pandas as pd


def timing_of(timing: pd.DataFrame, solutions: pd.DataFrame, label: str = "gauge") -> pd.DataFrame:
    """Timings of the runs (``label``, trial) that are among ``solutions``."""
    runs = solutions[[label, "trial"]].drop_duplicates()
    return timing.merge(runs, on=[label, "trial"], how="inner")


def paired_ratios(
    timing: pd.DataFrame, label: str = "gauge", reference: str = "fix", *, each: bool
) -> pd.DataFrame:
    """Time, of an iteration where ``each``, over the reference's: rows (trial, repeat), columns ``label``.

    Pairs in which a run is missing are left out.
    """
    seconds = timing["seconds"] / timing["iterations"] if each else timing["seconds"]
    table = timing.assign(value=seconds).pivot(index=["trial", "repeat"], columns=label, values="value")
    table = table.reindex(columns=sorted({*table.columns, reference})).dropna()
    return table.div(table[reference], axis=0)
