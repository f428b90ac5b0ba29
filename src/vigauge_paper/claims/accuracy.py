"""Claims on accuracy in simulation: Section V-B, Table II."""

from __future__ import annotations

from collections.abc import Iterable

from ..experiments.evidence import Evidence
from ..ids import ERRORS
from . import reasons
from .claim import Claim, Finding


def _worst_difference(e: Evidence, names: Iterable[str], gauge: str) -> float:
    """Largest relative bound of the intervals of gauge minus fixation, over names and errors."""
    worst = 0.0
    for name in names:
        for error in ERRORS:
            bounds = e.difference([name], error, gauge)
            worst = max(worst, abs(bounds.low), abs(bounds.high))
    return worst


def _same_accuracy(e: Evidence) -> Finding:
    worst = _worst_difference(e, e.configurations, "free")
    return f"intervals within {100 * worst:.2g} % of the RMSE", worst < e.criteria.accuracy_margin


def _neither_better(e: Evidence) -> Finding:
    verdicts, smaller = {}, 0
    for error in ERRORS:
        found = [e.difference([name], error, "free") for name in e.configurations]
        verdicts[error] = (sum(i.low > 0.0 for i in found), sum(i.high < 0.0 for i in found))
        smaller += sum(i.estimate > 0.0 for i in found)
    everywhere = any(len(e.configurations) in counts for counts in verdicts.values())
    total = len(ERRORS) * len(e.configurations)
    fix, free = (sum(counts[side] for counts in verdicts.values()) for side in (0, 1))
    text = (
        f"by paired intervals fix is better in {fix}, free in {free} of {total}; smaller mean: fix {smaller}"
    )
    return text, not everywhere


def _prior_is_fixation(e: Evidence) -> Finding:
    worst = max(
        abs(e.mean(name, error, "prior") - e.mean(name, error, "fix"))
        for name in e.configurations
        for error in ERRORS
    )
    return f"means differ by up to {worst:.1e} (m, deg, m/s)", worst < 0.5e-8


def _prior_is_fixation_within_margin(e: Evidence) -> Finding:
    worst = _worst_difference(e, e.configurations, "prior")
    return f"intervals within {100 * worst:.2g} % of the RMSE", worst < e.criteria.accuracy_margin


ACCURACY = (
    Claim(
        "same-accuracy",
        ("table2", "claims_statistics", "tolerance"),
        "V-B, Table II",
        "Fixation and free gauge have almost the same accuracy",
        "differences up to 1.2 %",
        "equivalence: paired intervals of free minus fix inside the margin, all configurations and errors",
        _same_accuracy,
        reasons.tolerance,
    ),
    Claim(
        "neither-better",
        ("table2", "claims_statistics", "tolerance"),
        "V-B, Table II",
        "Neither has the better accuracy in all configurations",
        "mixed",
        "for no error has one gauge its paired interval on the better side in all configurations",
        _neither_better,
        reasons.tolerance,
    ),
    Claim(
        "prior-fixation-digits",
        ("table2", "reading", "tolerance"),
        "V-B",
        "Prior at 1e5 and fixation agree to about 8 digits",
        "8 digits",
        "mean RMSE equal to 0.5e-8",
        _prior_is_fixation,
        reasons.reading,
    ),
    Claim(
        "prior-fixation",
        ("table2", "claims_statistics"),
        "V-B",
        "Prior at 1e5 has the accuracy of fixation",
        "identical",
        "equivalence: paired intervals of prior minus fix inside the margin",
        _prior_is_fixation_within_margin,
    ),
)
