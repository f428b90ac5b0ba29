"""One published number beside ours, with the range of ours over trials or repeats as the yardstick."""

from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike

from vigauge.geometry.so3 import Array

from ..ids import TABLES, Row


@dataclass(frozen=True)
class Number:
    """A published number and ours; ``case`` is a configuration, a sequence, or a weight (and step).

    ``low`` and ``high`` are the smallest and largest of ours over trials or repeats; nan where there is one
    problem only, whose number is the same in every repeat.
    """

    artefact: str
    case: str
    gauge: str
    quantity: str
    published: float
    ours: float
    low: float
    high: float

    @property
    def ratio(self) -> float:
        """Ours over the published: 1 where both are zero, nan where only the published is."""
        if self.published == 0.0:
            return 1.0 if self.ours == 0.0 else float("nan")
        return self.ours / self.published

    @property
    def inside(self) -> bool | None:
        """Whether the published number lies in our range; None where there is no range."""
        return None if np.isnan(self.low) else bool(self.low <= self.published <= self.high)

    def row(self) -> Row:
        return {**asdict(self), "ratio": self.ratio, "inside_our_range": self.inside}


def number(
    artefact: str,
    case: str,
    gauge: str,
    quantity: str,
    published: float,
    values: ArrayLike,
    statistic: Callable[[Array], float] = np.median,
) -> Number:
    """A number whose ours is the ``statistic`` of ``values``, and whose range is theirs."""
    found = np.asarray(values, dtype=float)
    low, high = (found.min(), found.max()) if len(found) > 1 else (np.nan, np.nan)
    ours = float(statistic(found)) if len(found) else float("nan")
    return Number(artefact, case, gauge, quantity, float(published), ours, float(low), float(high))


def machine(times: list[Number]) -> Row:
    """All times in one row: geometric means of both, and what lies one geometric spread around ours.

    The ratio is the factor between the machines; the range is that factor, times and over exp of the standard
    deviation of the logarithms of all ratios.
    """
    both = [time.published for time in times], [time.ours for time in times]
    published, ours = (float(np.exp(np.mean(np.log(values)))) for values in both)
    spread = float(np.exp(np.std(np.log([time.ratio for time in times]))))
    whole = Number("times", "all", "", "time_s", published, ours, ours / spread, ours * spread)
    return whole.row() | {"inside_our_range": None}


def counts(table: list[Number]) -> list[Row]:
    """By figure, and by table and gauge: how many numbers there are, have a range, and lie inside it."""
    groups: dict[str, list[bool | None]] = {}
    for each in table:
        by_gauge = f", {each.gauge}" if each.artefact in TABLES else ""
        groups.setdefault(each.artefact + by_gauge, []).append(each.inside)
    out: list[Row] = []
    for artefact, found in groups.items():
        ranged = [inside for inside in found if inside is not None]
        out.append(
            {
                "artefact": artefact,
                "numbers": len(found),
                "with a range": len(ranged),
                "inside our range": sum(ranged),
            }
        )
    return out


def score(table: list[Number]) -> tuple[float, float]:
    """Mean and largest |log ratio| of Table II under fixation."""
    logs = np.abs([np.log(n.ratio) for n in table if n.artefact == "table2" and n.gauge == "fix"])
    return float(np.mean(logs)), float(np.max(logs))
