"""The ledger: all claims, judged from the evidence."""

from __future__ import annotations

from ..experiments.evidence import Evidence, NoEvidenceError
from ..experiments.statistics import effect_size
from ..ids import ERRORS, NOT_FIXED
from .accuracy import ACCURACY
from .claim import Claim
from .cost import COST
from .covariance import COVARIANCE
from .prior_weight import PRIOR_WEIGHT
from .sequences import SEQUENCES
from .theory import THEORY

Row = dict[str, object]

CLAIMS: tuple[Claim, ...] = (*THEORY, *PRIOR_WEIGHT, *ACCURACY, *COST, *COVARIANCE, *SEQUENCES)

VERDICTS = {True: "holds", False: "differs", None: "not tested"}


def _judged(claim: Claim, evidence: Evidence) -> tuple[str, str]:
    """What was measured, and the verdict."""
    try:
        measured, holds = claim.judge(evidence)
    except NoEvidenceError as error:
        return str(error), VERDICTS[None]
    return measured, VERDICTS[None if holds is None else bool(holds)]


def ledger(evidence: Evidence) -> list[Row]:
    """All claims judged, a row each; ``verdict_as_printed`` with the prior's weight as the text has it."""
    rows: list[Row] = []
    printed = evidence.as_printed
    for claim in CLAIMS:
        measured, verdict = _judged(claim, evidence)
        rows.append(
            {
                "id": claim.id,
                "section": claim.section,
                "claim": claim.claim,
                "published": claim.published,
                "measured": measured,
                "criterion": claim.criterion,
                "verdict": verdict,
                "verdict_as_printed": _judged(claim, printed)[1],
            }
        )
    return rows


def explanations(evidence: Evidence) -> list[Row]:
    """Why, for each claim that an experiment explains: id and the sentence."""
    rows: list[Row] = []
    for claim in CLAIMS:
        if claim.why is None:
            continue
        try:
            rows.append({"id": claim.id, "why": claim.why(evidence)})
        except NoEvidenceError as error:
            rows.append({"id": claim.id, "why": f"not explained: {error}"})
    return rows


def paired_statistics(evidence: Evidence) -> list[Row]:
    """Paired differences to fixation of every simulated configuration, relative to fixation's mean.

    Interval, effect size (mean over standard deviation of the differences), and whether the
    interval lies inside the margin.
    """
    rows: list[Row] = []
    for name in evidence.configurations:
        for gauge in NOT_FIXED:
            for column in (*ERRORS, "iterations"):
                margin = (
                    evidence.criteria.cost_margin
                    if column == "iterations"
                    else evidence.criteria.accuracy_margin
                )
                try:
                    differences = evidence.paired(name, column, gauge, "fix")
                    found = evidence.difference([name], column, gauge)
                except NoEvidenceError:
                    continue
                rows.append(
                    {
                        "configuration": name,
                        "gauge": gauge,
                        "quantity": column,
                        "pairs": len(differences),
                        "relative_difference": found.estimate,
                        "low": found.low,
                        "high": found.high,
                        "effect_size": effect_size(differences),
                        "margin": margin,
                        "equivalent": found.within(margin),
                    }
                )
    return rows
