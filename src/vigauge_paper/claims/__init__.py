"""The ledger: the paper's claims, each with a criterion, our measurement and a computed verdict.

A claim is one function of the evidence. It returns what was measured and the verdict: 'not tested' where
there is no evidence (a stand-in is not EuRoC; no run converged), 'not resolvable' where an interval
includes both the published effect and none. Sameness is judged as equivalence: a paired interval inside a
stated margin; one that reaches over its limit resolves nothing either. Claims stand by theme, in the order
of the paper.
"""

from ..experiments.evidence import Evidence, NoEvidenceError
from ..experiments.statistics import Criteria, Interval
from ..ids import ERRORS
from .claim import Claim, Finding, Verdict
from .ledger import CLAIMS, THEMES, evidence_links, explanations, headline, ledger, paired_statistics

__all__ = [
    "CLAIMS",
    "ERRORS",
    "THEMES",
    "Claim",
    "Criteria",
    "Evidence",
    "Finding",
    "Interval",
    "NoEvidenceError",
    "Verdict",
    "evidence_links",
    "explanations",
    "headline",
    "ledger",
    "paired_statistics",
]
