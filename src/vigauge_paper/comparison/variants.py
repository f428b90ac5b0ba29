"""What single changes of our assumptions do to Table II, and why none of them is chosen afterwards."""

from pathlib import Path

import numpy as np
import pandas as pd

from ..ids import Row

# Of the random tables: numbers off by up to OFF either way, VARIANTS that move each by up to MOVED.
OFF, VARIANTS, MOVED = 10.0, 30, 3.0
# A number within this factor of the published one counts as explained.
FACTOR = 2.0


def _row(change: str, ratios: pd.Series) -> Row:
    logs = np.log(ratios)
    return {
        "change": change,
        "typical ratio": float(np.exp(logs.mean())),
        "smallest": float(ratios.min()),
        "largest": float(ratios.max()),
        "mean abs log ratio": float(logs.abs().mean()),
    }


def variants(hypothesis: Path, sensitivity: Path | None) -> list[Row]:
    """Ratios of Table II under fixation, ours over the paper's: as configured, and with one change each.

    ``hypothesis`` is the table of the hidden bias; ``sensitivity`` the summary of the sweep, if it was made.
    """
    table = pd.read_csv(hypothesis)
    out = [
        _row("none", table["without"] / table["published"]),
        _row("hidden bias, a hypothesis", table["ratio"]),
    ]
    if sensitivity is not None:
        swept = pd.read_csv(sensitivity, dtype={"value": str}).drop_duplicates(["parameter", "value"])
        columns = ["rmse_ratio", "rmse_ratio_low", "rmse_ratio_high", "rmse_score"]
        out += [
            {"change": f"{row['parameter']} = {row['value']}"}
            | dict(zip(list(out[0])[1:], row[columns], strict=True))
            for _, row in swept.iterrows()
        ]
    return out


def explained_by_chance(seed: int, numbers: int = 10_000) -> float:
    """Share of random numbers, off by more than FACTOR, that at least one variant brings inside it."""
    rng = np.random.default_rng(seed)
    off = rng.uniform(-np.log(OFF), np.log(OFF), numbers)
    off = off[np.abs(off) > np.log(FACTOR)]
    moved = off[:, None] + rng.uniform(-np.log(MOVED), np.log(MOVED), (len(off), VARIANTS))
    return float((np.abs(moved) <= np.log(FACTOR)).any(axis=1).mean())
