"""Claims on accuracy in simulation: Section V-B, Table II."""

from ..experiments.evidence import Evidence
from ..experiments.tolerance import at_the_minimum, largest_difference
from ..experiments.tolerance import sentence as stopping
from ..ids import ERRORS, FIX, FREE, PRIOR
from .claim import Claim, Finding, same, together, verdict

# Half a unit of the eighth decimal, in m, deg and m/s.
HALF_A_DIGIT = 0.5e-8


def _same_errors(e: Evidence, gauge: str) -> Finding:
    """Whether the errors of a gauge are fixation's, up to the margin, in every configuration."""
    found = [e.difference([name], error, gauge) for name in e.configurations for error in ERRORS]
    worst = max(max(abs(interval.low), abs(interval.high)) for interval in found)
    text = f"intervals within {100 * worst:.2g} % of the RMSE"
    return text, together(same(interval, e.criteria.accuracy_margin) for interval in found)


def _neither_better(e: Evidence) -> Finding:
    table = at_the_minimum(e)
    means = table.groupby(["experiment", "gauge"])[list(ERRORS)].mean()
    better = means.xs(FREE, level="gauge") < means.xs(FIX, level="gauge")
    worse = means.xs(FREE, level="gauge") > means.xs(FIX, level="gauge")
    largest = largest_difference(e, FREE)
    text = (
        f"at the minimum, free has the smaller mean RMSE in {int(better.to_numpy().sum())} of {better.size}; "
        f"the means differ by at most {100 * largest:.1e} %"
    )
    return text, verdict(not any(column.all() for table in (better, worse) for _, column in table.items()))


def _prior_is_fixation(e: Evidence) -> Finding:
    worst = max(
        abs(e.mean(name, error, PRIOR) - e.mean(name, error, FIX))
        for name in e.configurations
        for error in ERRORS
    )
    share = worst / HALF_A_DIGIT
    text = f"mean RMSE differ by up to {worst:.1e} (m, deg, m/s), {share:.2g} times the limit"
    return text, verdict(share < 1.0)


ACCURACY = (
    Claim(
        "same-accuracy",
        ("table2", "claims_statistics", "tolerance"),
        "V-B, Table II",
        "Fixation and free gauge have almost the same accuracy",
        "differences up to 1.2 %",
        "equivalence: paired intervals of free minus fix inside {accuracy_margin}, in all cases and errors",
        lambda e: _same_errors(e, FREE),
        stopping,
    ),
    Claim(
        "neither-better",
        ("table2", "tolerance"),
        "V-B, Table II",
        "Neither has the better accuracy in all configurations",
        "mixed",
        "runs to tolerance 1e-14: for no error has one gauge the smaller mean in all configurations",
        _neither_better,
        "The gauges have the same minimum, so what differs is rounding.",
    ),
    Claim(
        "prior-fixation-digits",
        ("table2", "reading"),
        "V-B",
        "Prior at 1e5 and fixation agree to about 8 digits",
        "8 digits",
        "mean RMSE differ by less than 5e-9, half a unit of the eighth decimal",
        _prior_is_fixation,
        "Runs end where the function tolerance stops them, which leaves the last decimals to chance.",
    ),
    Claim(
        "prior-fixation",
        ("table2", "claims_statistics"),
        "V-B",
        "Prior at 1e5 has the accuracy of fixation",
        "identical",
        "equivalence: paired intervals of prior minus fix inside {accuracy_margin}",
        lambda e: _same_errors(e, PRIOR),
        "Both runs end at the same minimum.",
    ),
)
