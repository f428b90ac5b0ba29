"""Every published number of Tables II and III and Figures 4 to 7 and 11 beside ours, with the ratio."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from ..figures.registry import FIGURES
from ..ids import ERRORS

Row = dict[str, object]

# Ratios beyond this, or below its inverse, are marked.
FACTOR = 2.0

_BOX = ("q1", "median", "q3")
# Our columns of the two panels of Fig. 6.
_PANELS = {"yaw_rad": "prior_yaw_rad", "position_m": "prior_position_m"}


@dataclass(frozen=True)
class Number:
    """A published number and ours; ``case`` is a configuration, a sequence, or a weight (and step)."""

    artefact: str
    case: str
    gauge: str
    quantity: str
    published: float
    ours: float

    @property
    def ratio(self) -> float:
        """Ours over the published: 1 where both are zero, nan where only the published is."""
        if self.published == 0.0:
            return 1.0 if self.ours == 0.0 else float("nan")
        return self.ours / self.published

    @property
    def outside(self) -> bool:
        """Whether the ratio lies outside a factor of two; a ratio that does not exist does."""
        return not 1.0 / FACTOR <= self.ratio <= FACTOR


def numbers(artefacts: Path, published: Path, sequences: Mapping[str, str]) -> list[Number]:
    """All numbers that can be compared.

    ``artefacts`` and ``published`` are the folders of our results and of the paper's numbers;
    ``sequences`` maps our names to the paper's, empty where ours are not the paper's.
    """

    def pair(name: str) -> tuple[Path, Path]:
        file = f"{FIGURES[name].stem if name in FIGURES else name}.csv"
        return artefacts / file, published / file

    out = [
        *_table(*pair("table2"), "table2", None),
        *_prior_accuracy(*pair("fig04")),
        *_prior_cost(*pair("fig05")),
        *_prior_paths(*pair("fig06")),
        *_cost(*pair("fig07"), "fig07", None),
    ]
    if sequences:
        out += _table(*pair("table3"), "table3", sequences)
        out += _cost(*pair("fig11"), "fig11", sequences)
    return out


def _cases(theirs: pd.Series, names: Mapping[str, str] | None) -> Iterator[tuple[str, str]]:
    """Pairs (our name, the paper's name)."""
    if names is not None:
        yield from names.items()
    else:
        yield from ((name, name) for name in dict.fromkeys(theirs))


def _table(ours: Path, theirs: Path, artefact: str, names: Mapping[str, str] | None) -> Iterator[Number]:
    own, paper = pd.read_csv(ours), pd.read_csv(theirs)
    key, their_key = own.columns[0], paper.columns[0]
    for name, their_name in _cases(paper[their_key], names):
        for _, row in paper[paper[their_key] == their_name].iterrows():
            match = own[(own[key] == name) & (own["gauge"] == row["gauge"])]
            for error in ERRORS:
                yield Number(
                    artefact,
                    name,
                    str(row["gauge"]),
                    error,
                    float(row[error]),
                    float(match[error].iloc[0]),
                )


def _by_weight(table: pd.DataFrame) -> dict[float, pd.DataFrame]:
    numeric = table[table["weight"] != "free"]
    return {float(weight): part for weight, part in numeric.groupby("weight", sort=False)}


def _prior_accuracy(ours: Path, theirs: Path) -> Iterator[Number]:
    own = _by_weight(pd.read_csv(ours, dtype={"weight": str}))
    for _, row in pd.read_csv(theirs).iterrows():
        weight = float(row["weight_guess"])
        if weight in own:
            # The published column of the rotation says rad and holds degrees.
            for error, column in zip(ERRORS, ("p_rmse_m", "phi_rmse_rad", "v_rmse_mps"), strict=True):
                yield Number(
                    "fig04",
                    f"{weight:g}",
                    "prior",
                    error,
                    float(row[column]),
                    float(own[weight][error].iloc[0]),
                )


def _prior_cost(ours: Path, theirs: Path) -> Iterator[Number]:
    own = _by_weight(pd.read_csv(ours, dtype={"weight": str}))
    for _, row in pd.read_csv(theirs).iterrows():
        weight = float(row["weight"])
        if weight in own:
            match = own[weight]
            match = match[match["quantity"] == row["quantity"]].iloc[0]
            for part in _BOX:
                yield Number(
                    "fig05",
                    f"{weight:g}",
                    "prior",
                    f"{row['quantity']} {part}",
                    float(row[part]),
                    float(match[part]),
                )


def _prior_paths(ours: Path, theirs: Path) -> Iterator[Number]:
    own = pd.read_csv(ours, dtype={"weight": str}).set_index(["weight", "iteration"])
    paper = pd.read_csv(theirs, dtype={"weight": str})
    for _, row in paper.iterrows():
        if row["weight"] not in own.index:
            continue
        # A run that has ended stays where it ended.
        last = int(own.loc[row["weight"]].index.max())
        place = (row["weight"], min(int(row["step"]), last))
        gauge = "free" if row["weight"] == "free" else "prior"
        case = f"{row['weight']}, step {row['step']}"
        column = _PANELS[row["panel"]]
        if int(row["step"]) > 0:
            yield Number(
                "fig06", case, gauge, column, float(row["prior_error"]), float(own.loc[place, column])
            )
        if column == "prior_yaw_rad":  # the abscissa is the same in both panels
            yield Number(
                "fig06",
                case,
                gauge,
                "mean_reprojection_px",
                float(row["mean_reprojection_px"]),
                float(own.loc[place, "mean_reprojection_px"]),
            )


def _cost(ours: Path, theirs: Path, artefact: str, names: Mapping[str, str] | None) -> Iterator[Number]:
    own, paper = pd.read_csv(ours), pd.read_csv(theirs)
    key = paper.columns[0]
    for name, their_name in _cases(paper[key], names):
        for _, row in paper[paper[key] == their_name].iterrows():
            match = own[
                (own["experiment"] == name)
                & (own["gauge"] == row["gauge"])
                & (own["quantity"] == row["quantity"])
            ].iloc[0]
            ratio = row["quantity"] == "time_per_iteration_ratio"
            # The paper draws one mark for the ratio; it stands beside our median.
            for part in ("median",) if ratio else _BOX:
                yield Number(
                    artefact,
                    name,
                    str(row["gauge"]),
                    str(row["quantity"]) if ratio else f"{row['quantity']} {part}",
                    float(row["value" if ratio else part]),
                    float(match[part]),
                )


def comparison_rows(table: list[Number]) -> list[Row]:
    """A row a number: what it is, published, ours, ratio, outside_factor_two."""
    return [{**asdict(n), "ratio": n.ratio, "outside_factor_two": n.outside} for n in table]


def score(table: list[Number]) -> tuple[float, float]:
    """Mean and largest |log ratio| of Table II under fixation: how near the assumptions come to the paper."""
    logs = np.abs(
        [np.log(number.ratio) for number in table if number.artefact == "table2" and number.gauge == "fix"]
    )
    return float(np.mean(logs)), float(np.max(logs))
