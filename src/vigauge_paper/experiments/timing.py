"""Times of solves compared in pairs: the same trial under two gauges or weights, each at its quickest."""

from pathlib import Path

import pandas as pd

from ..ids import FIX, FIX_AGAIN


def read_timing(file: Path, experiment: str) -> pd.DataFrame:
    """Times of one experiment, of a file that may hold several."""
    table = pd.read_csv(file)
    return table[table["experiment"] == experiment]


def timing_of(timing: pd.DataFrame, solutions: pd.DataFrame, label: str = "gauge") -> pd.DataFrame:
    """Times of the runs (``label``, trial) that are among ``solutions``: the quickest repeat of each.

    Fixation's second timing is of the same runs.

    Whatever else runs can only slow a solve, so the quickest repeat is the nearest to its own time. Of a
    single trial all repeats are kept: they are all there is to take an interval from.
    """
    runs = solutions[[label, "trial"]].drop_duplicates()
    runs = pd.concat([runs, runs[runs[label] == FIX].assign(**{label: FIX_AGAIN})])
    timing = timing.merge(runs, on=[label, "trial"], how="inner")
    if timing["trial"].nunique() < 2:
        return timing
    return timing.loc[timing.groupby([label, "trial"], sort=False)["seconds"].idxmin()]


def paired_ratios(
    timing: pd.DataFrame, label: str = "gauge", reference: str = FIX, *, each: bool
) -> pd.DataFrame:
    """Time, of an iteration where ``each``, over the reference's: a row a trial, columns ``label``.

    ``timing`` is that of :func:`timing_of`; of a single trial, a row is a repeat. Pairs in which a run is
    missing are left out. Where fixation is timed twice, others are compared with the mean of both, which is
    steadier, and the second with the first.
    """
    seconds = timing["seconds"] / timing["iterations"] if each else timing["seconds"]
    pair = "trial" if timing["trial"].nunique() > 1 else "repeat"
    table = timing.assign(value=seconds).pivot(index=pair, columns=label, values="value")
    table = table.reindex(columns=sorted({*table.columns, reference})).dropna()
    if reference != FIX or FIX_AGAIN not in table:
        return table.div(table[reference], axis=0)
    both = table[[FIX, FIX_AGAIN]].mean(axis=1)
    return table.assign(**{FIX: both}).div(both, axis=0).assign(**{FIX_AGAIN: table[FIX_AGAIN] / table[FIX]})
