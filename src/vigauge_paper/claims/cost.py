"""Claims on iterations and times in simulation: Section V-B, Fig. 7."""

from ..experiments import damping, iteration_time
from ..experiments.evidence import Evidence, NoEvidenceError
from ..experiments.statistics import Interval
from ..ids import CONFIGURATIONS, FIX, FIX_AGAIN, FREE, NOT_FIXED, PRIOR
from .claim import Claim, Finding, resolve, same, spread, together

# Published effects, Fig. 7: difference of the median iterations in the five, median ratio of their times,
# and mean ratio of the times an iteration over all configurations.
FEWER_ITERATIONS = -1.0
TIME_RATIO = 0.9
ITERATION_RATIO = {FREE: 1.016, PRIOR: 1.012}

SINE_RANDOM = "sine_random"
FREE_NEEDS_FEWER = tuple(name for name in CONFIGURATIONS if name != SINE_RANDOM)


def _five(e: Evidence) -> list[str]:
    names = [name for name in FREE_NEEDS_FEWER if name in e.solutions]
    if not names:
        raise NoEvidenceError("none of the configurations that the claim is about")
    return names


def _fewer(e: Evidence, name: str) -> Interval:
    """Iterations of the free gauge minus fixation's."""
    return e.mean_interval(e.paired(name, "iterations", FREE, FIX))


def _free_needs_fewer(e: Evidence) -> Finding:
    found = {name: _fewer(e, name) for name in _five(e)}
    parts = [f"{name} {interval.estimate:+.2f}" for name, interval in found.items()]
    if SINE_RANDOM in e.configurations:
        parts.append(f"the exception {SINE_RANDOM} {_fewer(e, SINE_RANDOM).estimate:+.2f}")
    text = f"mean difference to fixation: {', '.join(parts)}"
    return text, together(resolve(interval, FEWER_ITERATIONS) for interval in found.values())


def _free_takes_less_time(e: Evidence) -> Finding:
    names = _five(e)
    ratio = e.time_ratio(names, FREE)
    by_name = spread([e.time_ratio([name], FREE).estimate for name in names])
    text = f"median paired ratio {ratio}, by configuration {by_name}, on {e.cpu}"
    return text, resolve(ratio, TIME_RATIO, 1.0)


def _fixation_is_fastest_an_iteration(e: Evidence) -> Finding:
    ratios = {gauge: e.time_ratio(e.configurations, gauge, each=True) for gauge in NOT_FIXED}
    shown = "; ".join(f"{gauge} {ratio}" for gauge, ratio in ratios.items())
    again = e.time_ratio(e.configurations, FIX_AGAIN, each=True)
    text = f"median paired ratio to fixation: {shown}; to itself, timed twice, {again}, on {e.cpu}"
    found = together(resolve(ratio, ITERATION_RATIO[gauge], 1.0) for gauge, ratio in ratios.items())
    return text, found


def _prior_costs_as_fixation(e: Evidence) -> Finding:
    count = e.difference(e.configurations, "iterations", PRIOR)
    time = e.time_ratio(e.configurations, PRIOR)
    margin = e.criteria.cost_margin
    text = f"relative difference of iterations {count}; median paired ratio of times {time}; up to "
    text += f"{100 * margin:g} % counts as the same; on {e.cpu}"
    return text, together((same(count, margin), same(time, margin, 1.0)))


COST = (
    Claim(
        "fewer-iterations",
        ("fig07", "claims_statistics", "damping"),
        "V-B, Fig. 7",
        "Free takes fewer iterations (all but sine random)",
        "medians 4-6 against 5-7",
        "interval of the paired difference below zero in each of the five; the exception is only shown",
        _free_needs_fewer,
        damping.sentence,
    ),
    Claim(
        "free-faster",
        ("fig07", "damping"),
        "V-B, Fig. 7",
        "Free takes less time to converge (all but sine random)",
        "median ratios 0.84 to 0.99",
        "interval of the median paired ratio of times below 1 over the five",
        _free_takes_less_time,
        "Each iteration fewer saves more time than the four further parameters of the free gauge cost.",
        timed=True,
    ),
    Claim(
        "time-per-iteration",
        ("fig07", "iteration_time"),
        "V-B, Fig. 7",
        "Fixation takes the least time per iteration",
        "ratios 1.000 to 1.026",
        "interval of the median paired ratio to fix above 1, for free and for prior, over all configurations",
        _fixation_is_fastest_an_iteration,
        iteration_time.sentence,
        timed=True,
    ),
    Claim(
        "prior-cost",
        ("fig07", "claims_statistics"),
        "V-B, Fig. 7",
        "The cost of prior and fixation is almost identical",
        "medians of iterations equal",
        "equivalence: intervals of iterations and of paired times within {cost_margin} of fixation's",
        _prior_costs_as_fixation,
        "A strong prior takes the steps of fixation, each with four parameters and a residual more.",
        timed=True,
    ),
)
