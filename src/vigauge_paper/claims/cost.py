"""Claims on iterations and times in simulation: Section V-B, Fig. 7."""

from __future__ import annotations

from collections.abc import Iterable

from ..experiments.evidence import Evidence, NoEvidenceError
from ..experiments.statistics import Interval
from ..ids import CONFIGURATIONS, NOT_FIXED
from . import reasons
from .claim import Claim, Finding, spread

FREE_NEEDS_FEWER = tuple(name for name in CONFIGURATIONS if name != "sine_random")


def _five(e: Evidence) -> list[str]:
    names = [name for name in FREE_NEEDS_FEWER if name in e.solutions]
    if not names:
        raise NoEvidenceError("none of the configurations that the claim is about")
    return names


def _iterations(e: Evidence, names: Iterable[str]) -> tuple[list[str], list[tuple[float, float]]]:
    texts, intervals = [], []
    for name in names:
        low, high = e.interval(e.paired(name, "iterations", "free", "fix"))
        intervals.append((low, high))
        means = e.mean(name, "iterations", "free"), e.mean(name, "iterations", "fix")
        texts.append(f"{name} {means[0]:.2f} against {means[1]:.2f} [{low:+.2f}, {high:+.2f}]")
    return texts, intervals


def _free_needs_fewer(e: Evidence) -> Finding:
    texts, intervals = _iterations(e, _five(e))
    return "; ".join(texts), all(high < 0 for _, high in intervals)


def _sine_random_is_the_exception(e: Evidence) -> Finding:
    texts, ((low, high),) = _iterations(e, ["sine_random"])
    return texts[0], low <= 0 <= high


def _by_configuration(e: Evidence, gauge: str, names: Iterable[str], each: bool) -> list[float]:
    return [e.time_ratio([name], gauge, each=each).estimate for name in names]


def _free_takes_less_time(e: Evidence) -> Finding:
    names = _five(e)
    ratio = e.time_ratio(names, "free")
    by_name = spread(_by_configuration(e, "free", names, each=False))
    return f"median paired ratio {ratio}, by configuration {by_name}, on {e.cpu}", ratio.high < 1.0


def _fixation_is_fastest_an_iteration(e: Evidence) -> Finding:
    texts, ratios = [], []
    for gauge in NOT_FIXED:
        ratio: Interval = e.time_ratio(e.configurations, gauge, each=True)
        ratios.append(ratio)
        texts.append(
            f"{gauge} {ratio}, by configuration {spread(_by_configuration(e, gauge, e.configurations, True))}"
        )
    return f"median paired ratio: {'; '.join(texts)}, on {e.cpu}", all(ratio.low > 1.0 for ratio in ratios)


def _prior_costs_as_fixation(e: Evidence) -> Finding:
    count = e.difference(e.configurations, "iterations", "prior")
    time = e.time_ratio(e.configurations, "prior")
    margin = e.criteria.cost_margin
    text = f"relative difference of iterations {count}; median paired ratio of times {time}, on {e.cpu}"
    return text, count.within(margin) and time.within(margin, centre=1.0)


COST = (
    Claim(
        "fewer-iterations",
        ("fig07", "claims_statistics", "damping"),
        "V-B, Fig. 7",
        "Free takes fewer iterations (all but sine random)",
        "medians 4-6 against 5-7",
        "interval of the paired difference below zero in each of the five",
        _free_needs_fewer,
        reasons.damping,
    ),
    Claim(
        "sine-random",
        ("fig07", "claims_statistics", "damping"),
        "V-B, Fig. 7",
        "On sine random free takes as many iterations as fixation",
        "5 against 5",
        "interval of the paired difference contains zero",
        _sine_random_is_the_exception,
        reasons.damping,
    ),
    Claim(
        "free-faster",
        ("fig07", "damping"),
        "V-B, Fig. 7",
        "Free takes less time to converge (all but sine random)",
        "median ratios 0.84 to 0.99",
        "interval of the median paired ratio of times below 1 over the five",
        _free_takes_less_time,
        reasons.damping,
    ),
    Claim(
        "time-per-iteration",
        ("fig07", "iteration_time"),
        "V-B, Fig. 7",
        "Fixation takes the least time per iteration",
        "ratios 1.000 to 1.026",
        "interval of the median paired ratio to fix above 1, for free and for prior, over all configurations",
        _fixation_is_fastest_an_iteration,
        reasons.iteration_time,
    ),
    Claim(
        "prior-cost",
        ("fig07", "claims_statistics"),
        "V-B, Fig. 7",
        "The cost of prior and fixation is almost identical",
        "medians of iterations equal",
        "equivalence: intervals of iterations and of paired times inside the cost margin",
        _prior_costs_as_fixation,
    ),
)
