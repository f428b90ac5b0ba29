"""The ledger: all claims, judged from the evidence."""

from collections.abc import Container

from ..experiments.evidence import Evidence, NoEvidenceError
from ..experiments.statistics import effect_size
from ..ids import ERRORS, NOT_FIXED, Row
from .accuracy import ACCURACY
from .claim import Claim, Finding, Verdict
from .cost import COST
from .covariance import COVARIANCE
from .prior_weight import PRIOR_WEIGHT
from .sequences import SEQUENCES
from .theory import THEORY

# In the order of the paper.
THEMES: dict[str, tuple[Claim, ...]] = {
    "The gauge": THEORY,
    "The prior's weight": PRIOR_WEIGHT,
    "Accuracy": ACCURACY,
    "Cost": COST,
    "Covariance": COVARIANCE,
    "Image sequences": SEQUENCES,
}
CLAIMS: tuple[Claim, ...] = tuple(claim for claims in THEMES.values() for claim in claims)

# Why a claim cannot be resolved.
UNRESOLVED = (
    "our interval includes both the published effect and no effect, or it reaches over the limit of what "
    "counts as the same"
)

# Claims whose verdicts depend on the machine and on how idle it was.
TIMED = tuple(claim.id for claim in CLAIMS if claim.timed)

# The only failure of substance: it leads the list of what differs.
FIRST_OF_DIFFERENCES = "large-weights-unstable"


def judged(claim: Claim, evidence: Evidence) -> Finding:
    """What was measured and the verdict; without evidence 'not tested', and the reason."""
    try:
        return claim.judge(evidence)
    except NoEvidenceError as error:
        return str(error), Verdict.UNTESTED


def ledger(evidence: Evidence) -> list[Row]:
    """All claims judged, a row each; ``verdict_as_printed`` with the prior's weight as the text has it."""
    rows: list[Row] = []
    printed = evidence.as_printed
    for claim in CLAIMS:
        measured, verdict = judged(claim, evidence)
        rows.append(
            {
                "id": claim.id,
                "section": claim.section,
                "claim": claim.claim,
                "published": claim.published,
                "measured": measured,
                "criterion": claim.criterion.format_map(evidence.criteria.in_words()),
                "verdict": str(verdict),
                "verdict_as_printed": str(judged(claim, printed)[1]),
            }
        )
    return rows


def explanations(evidence: Evidence) -> list[Row]:
    """Why each claim fares as it does: id and a sentence."""
    rows: list[Row] = []
    for claim in CLAIMS:
        try:
            why = claim.why if isinstance(claim.why, str) else claim.why(evidence)
        except NoEvidenceError as error:
            why = f"Not explained: {error}."
        rows.append({"id": claim.id, "why": why})
    return rows


def evidence_links(claim_id: str, files: Container[str]) -> list[str]:
    """Names of a claim's evidence that there are files of."""
    (claim,) = (claim for claim in CLAIMS if claim.id == claim_id)
    return [name for name in claim.evidence if name in files]


def headline(rows: list[Row]) -> str:
    """What reproduces, what does not and what cannot be resolved, in sentences."""
    named: dict[str, list[str]] = {verdict: [] for verdict in Verdict}
    for row in sorted(rows, key=lambda row: row["id"] != FIRST_OF_DIFFERENCES):
        named[str(row["verdict"])].append(str(row["claim"]))
    sentences = [f"{len(named[Verdict.HOLDS])} of {len(rows)} claims of the paper hold in this reproduction."]
    for verdict, text in (
        (Verdict.DIFFERS, "do not"),
        (Verdict.UNRESOLVED, f"cannot be resolved: {UNRESOLVED}"),
        (Verdict.UNTESTED, "were not tested here"),
    ):
        if named[verdict]:
            listed = "; ".join(f'"{claim}"' for claim in named[verdict])
            sentences.append(f"{len(named[verdict])} {text}. These are: {listed}.")
    if timed := sum(row["id"] in TIMED and row["verdict"] != Verdict.UNTESTED for row in rows):
        sentences.append(
            f"{timed} verdicts rest on times (what was measured names the processor): they depend on the "
            "machine and on how idle it was."
        )
    changed = sum(row["verdict"] != row["verdict_as_printed"] for row in rows)
    sentences.append(
        "The prior's weight multiplies the residual here, as in the paper's figures. With the weight as "
        f"information, as in its text, {changed} verdicts would change (column verdict_as_printed)."
    )
    return " ".join(sentences)


def paired_statistics(evidence: Evidence) -> list[Row]:
    """Paired differences to fixation of every simulated configuration, relative to fixation's mean.

    Interval, effect size (mean over standard deviation of the differences), and whether the
    interval lies inside the margin.
    """
    rows: list[Row] = []
    for name in evidence.configurations:
        for gauge in NOT_FIXED:
            for column in (*ERRORS, "iterations"):
                criteria = evidence.criteria
                margin = criteria.cost_margin if column == "iterations" else criteria.accuracy_margin
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
