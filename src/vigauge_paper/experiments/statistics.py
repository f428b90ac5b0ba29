"""Paired statistics over trials: bootstrap intervals, effect size, equivalence."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from vigauge.geometry.so3 import Array


@dataclass(frozen=True)
class Criteria:
    """Margins of the ledger.

    ``accuracy_margin`` relative difference of RMSE that counts as the same, ``cost_margin`` of
    iterations and times, ``covariance_margin`` of covariances (Frobenius); ``confidence`` of
    intervals; ``resamples`` and ``seed`` of the bootstrap; ``sweep_span`` relative span of the
    RMSE over prior weights that counts as "very similar"; ``settled_span`` share of the span over all
    weights that counts as settled. config/README.md has each one's reason.
    """

    accuracy_margin: float
    cost_margin: float
    covariance_margin: float
    confidence: float
    resamples: int
    seed: int
    sweep_span: float
    settled_span: float

    def in_words(self) -> dict[str, str]:
        """Margins and spans in per cent, by name: what a claim's criterion quotes."""
        return {
            name: f"{100 * value:g} %"
            for name, value in asdict(self).items()
            if name.endswith(("_margin", "_span"))
        }


@dataclass(frozen=True)
class Interval:
    """Estimate with the bounds of its bootstrap interval."""

    estimate: float
    low: float
    high: float

    def within(self, margin: float, centre: float = 0.0) -> bool:
        """Equivalence: the whole interval closer to ``centre`` than ``margin``."""
        return max(abs(self.low - centre), abs(self.high - centre)) < margin

    def __str__(self) -> str:
        return f"{self.estimate:.3g} [{self.low:.3g}, {self.high:.3g}]"


def bootstrap(groups: Sequence[Array], statistic: Callable[[Array], Array], criteria: Criteria) -> Interval:
    """Interval of a statistic of all values, trials drawn anew within each group.

    ``statistic`` reduces the last axis of an array.
    """
    rng = np.random.default_rng(criteria.seed)
    drawn = [group[rng.integers(0, len(group), (criteria.resamples, len(group)))] for group in groups]
    tail = 50.0 * (1.0 - criteria.confidence)
    low, high = np.percentile(statistic(np.concatenate(drawn, axis=1)), [tail, 100.0 - tail])
    return Interval(float(statistic(np.concatenate(groups))), float(low), float(high))


def mean(values: Array) -> Array:
    return np.mean(values, axis=-1)


def median(values: Array) -> Array:
    return np.median(values, axis=-1)


def effect_size(differences: Array) -> float:
    """Mean of paired differences over their standard deviation (Cohen's d_z).

    0 where all are zero, infinite where all are the same, nan for a single pair.
    """
    if len(differences) < 2:
        return float("nan")
    spread = float(np.std(differences, ddof=1))
    centre = float(np.mean(differences))
    return 0.0 if centre == 0.0 else centre / spread if spread > 0.0 else float(np.copysign(np.inf, centre))
