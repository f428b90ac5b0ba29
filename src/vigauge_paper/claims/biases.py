"""Which claims still hold with biases in the state: those of the ledger, judged on experiment 'biases'."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from vigauge.geometry.so3 import Array

from ..experiments.biases import ERRORS_IN_WORDS, SECONDS
from ..experiments.evidence import NoEvidenceError
from ..experiments.statistics import Criteria, Interval, bootstrap, mean, median
from ..ids import BIAS_ERRORS, ERRORS, ESTIMATED, FIX, FREE, KNOWN, NOT_FIXED, PRIOR, Row
from .claim import Verdict, resolve, same, together, verdict
from .cost import FEWER_ITERATIONS, FREE_NEEDS_FEWER, ITERATION_RATIO
from .covariance import PUBLISHED_CONVERGED
from .ledger import CLAIMS

ITERATIONS, NULLITY = "iterations", "null_space"
SAME_POINT, CONVERGED = "relative_frobenius_same_point", "relative_frobenius_converged"


@dataclass(frozen=True)
class _Found:
    """What a claim's judge says: what was measured by quantity and gauge, the verdict, a sentence."""

    measured: dict[tuple[str, str], Interval]
    margin: float
    verdict: Verdict
    sentence: str


@dataclass(frozen=True)
class _Runs:
    """Runs of the experiment that converged, all with biases known or all with them estimated."""

    table: pd.DataFrame
    criteria: Criteria

    def pairs(self, column: str, gauge: str, names: Iterable[str] = ()) -> list[pd.DataFrame]:
        """By configuration, columns ``gauge`` and fixation's, a row a trial that has both."""
        groups = []
        for name, part in self.table.groupby("experiment", sort=False):
            if names and name not in names:
                continue
            pair = part.pivot(index="trial", columns="gauge", values=column).reindex(columns=[gauge, FIX])
            if len(pair := pair.dropna()):
                groups.append(pair)
        if not groups:
            raise NoEvidenceError(f"no trial converged under both {gauge} and {FIX}")
        return groups

    def relative(self, column: str, gauge: str) -> Interval:
        """Mean difference to fixation over fixation's mean in each configuration."""
        pairs = self.pairs(column, gauge)
        return bootstrap(
            [((p[gauge] - p[FIX]) / p[FIX].mean()).to_numpy(float) for p in pairs], mean, self.criteria
        )

    def values(self, column: str, gauge: str) -> Array:
        """Of all runs of a gauge that have a covariance."""
        found = self.table.loc[self.table["gauge"] == gauge, column].dropna().to_numpy(float)
        if not len(found):
            raise NoEvidenceError(f"no run of {gauge} has a covariance")
        return found


def _accuracy(runs: _Runs, gauge: str) -> _Found:
    margin = runs.criteria.accuracy_margin
    quantities = [*ERRORS, *(name for name in BIAS_ERRORS if runs.table[name].notna().any())]
    found = {(name, gauge): runs.relative(name, gauge) for name in quantities}
    judged = together(same(interval, margin) for interval in found.values())
    (name, _), worst = max(found.items(), key=lambda item: abs(item[1].estimate))
    text = (
        f"The mean errors of the {_named(gauge)} differ from fixation's by at most "
        f"{_percent(abs(worst.estimate))}, in {ERRORS_IN_WORDS[name]} (interval {_percent(worst.low)} to "
        f"{_percent(worst.high)}; up to {_percent(margin)} counts as the same)."
    )
    return _Found(found, margin, judged, text)


def _named(gauge: str) -> str:
    return {FREE: "free gauge", PRIOR: "prior"}[gauge]


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %"


def _iterations(runs: _Runs) -> _Found:
    pairs = runs.pairs(ITERATIONS, FREE, FREE_NEEDS_FEWER)
    groups = [(pair[FREE] - pair[FIX]).to_numpy(float) for pair in pairs]
    found = bootstrap(groups, mean, runs.criteria)
    fixed = float(np.mean([pair[FIX].mean() for pair in pairs]))
    text = (
        f"The free gauge takes {abs(found.estimate):.2f} iterations "
        f"{'fewer' if found.estimate < 0.0 else 'more'} than fixation's {fixed:.1f}, mean of all "
        f"flights but sine random, taken together (interval of the difference {found.low:+.2f} to "
        f"{found.high:+.2f}); the ledger asks for fewer on each of them."
    )
    return _Found({(ITERATIONS, FREE): found}, 0.0, resolve(found, FEWER_ITERATIONS), text)


def _time(runs: _Runs) -> _Found:
    each = _Runs(
        runs.table.assign(**{SECONDS: runs.table["seconds"] / runs.table["iterations"]}), runs.criteria
    )
    found = {}
    for gauge in NOT_FIXED:
        groups = [(pair[gauge] / pair[FIX]).to_numpy(float) for pair in each.pairs(SECONDS, gauge)]
        found[SECONDS, gauge] = bootstrap(groups, median, runs.criteria)
    text = " and ".join(
        f"{one.estimate:.3f} (interval {one.low:.3f} to {one.high:.3f}) for the {_named(gauge)}"
        for (_, gauge), one in found.items()
    )
    judged = together(resolve(one, ITERATION_RATIO[gauge], 1.0) for (_, gauge), one in found.items())
    return _Found(found, 0.0, judged, f"The time of an iteration over fixation's is {text}.")


def _largest(values: Array) -> Interval:
    """The largest of the values; from their median on."""
    return Interval(float(values.max()), float(np.median(values)), float(values.max()))


def _identity(runs: _Runs) -> _Found:
    found = _largest(runs.values(SAME_POINT, FREE))
    text = f"At one point, the transformed and the fixed covariance differ by at most {found.estimate:.1e}."
    return _Found({(SAME_POINT, FREE): found}, 1e-9, verdict(found.estimate <= 1e-9), text)


def _converged(runs: _Runs) -> _Found:
    found = _largest(runs.values(CONVERGED, FREE))
    text = (
        "The covariance transformed from the free estimate differs from that of fixation's estimate by at "
        f"most {_percent(found.estimate)} (median {_percent(found.low)}; the paper: "
        f"{_percent(PUBLISHED_CONVERGED)})."
    )
    within = verdict(found.estimate <= PUBLISHED_CONVERGED)
    return _Found({(CONVERGED, FREE): found}, PUBLISHED_CONVERGED, within, text)


def _null_space(runs: _Runs) -> _Found:
    found = runs.values("parameters", FREE) - runs.values("hessian_rank", FREE)
    low, high = int(found.min()), int(found.max())
    sizes = sorted({int(size) for size in runs.values("parameters", FREE)})
    text = (
        f"The Hessian of {' or '.join(map(str, sizes))} parameters has a null space of dimension "
        f"{low if low == high else f'{low} to {high}'} in all {len(found)} runs of the free gauge."
    )
    interval = Interval(float(high), float(low), float(high))
    return _Found({(NULLITY, FREE): interval}, 4.0, verdict(low == high == 4), text)


# By the id of the claim in the ledger.
_JUDGES: dict[str, Callable[[_Runs], _Found]] = {
    "same-accuracy": lambda runs: _accuracy(runs, FREE),
    "prior-fixation": lambda runs: _accuracy(runs, PRIOR),
    "fewer-iterations": _iterations,
    "time-per-iteration": _time,
    "identity": _identity,
    "transformed-simulation": _converged,
    "rank": _null_space,
}


def judge_biases(runs: pd.DataFrame, criteria: Criteria) -> list[Row]:
    """A row a claim, quantity and gauge, with biases known and estimated.

    ``estimate``, ``low`` and ``high`` are: of errors, the mean difference to fixation over its mean, with its
    interval; of iterations, the mean difference; of seconds an iteration, the median ratio; of distances of
    covariances, the largest, from their median on; of the null space, the largest dimension, from the
    smallest on. ``margin`` is what counts as the same, or the limit; 0 where there is none.
    """
    claims = {claim.id: claim.claim for claim in CLAIMS}
    rows: list[Row] = []
    for id, judge in _JUDGES.items():
        for biases in (KNOWN, ESTIMATED):
            about: Row = {"id": id, "claim": claims[id], "biases": biases}
            part = runs[(runs["biases"] == biases) & runs["converged"]]
            try:
                found = judge(_Runs(part, criteria))
            except NoEvidenceError as error:
                found = _Found({}, 0.0, Verdict.UNTESTED, f"Not tested: {error}.")
            judged: Row = {"verdict": str(found.verdict), "sentence": found.sentence}
            measured = found.measured or {("", ""): Interval(np.nan, np.nan, np.nan)}
            rows += [
                {
                    **about,
                    "quantity": quantity,
                    "gauge": gauge,
                    "estimate": interval.estimate,
                    "low": interval.low,
                    "high": interval.high,
                    "margin": found.margin,
                    **judged,
                }
                for (quantity, gauge), interval in measured.items()
            ]
    return rows
