"""A claim of the paper, and what several claims share."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum

from ..experiments.evidence import Evidence
from ..experiments.statistics import Interval
from ..ids import STAND_IN


class Verdict(StrEnum):
    """How a claim fares.

    ``UNRESOLVED``: an interval includes both the published effect and none (:func:`resolve`), or reaches over
    the limit of what counts as the same (:func:`same`).
    """

    HOLDS = "holds"
    DIFFERS = "differs"
    UNRESOLVED = "not resolvable"
    UNTESTED = "not tested"


Finding = tuple[str, Verdict]


@dataclass(frozen=True)
class Claim:
    """One statement of the paper and how it is judged.

    ``evidence`` names what shows it: tables, figures, and tables of the explaining experiments.
    ``criterion`` may name margins of the ledger in braces. ``judge`` returns what was measured, and the
    verdict. ``why`` says in one sentence why it is so. ``timed``: the verdict rests on measured times.
    """

    id: str
    evidence: tuple[str, ...]
    section: str
    claim: str
    published: str
    criterion: str
    judge: Callable[[Evidence], Finding]
    why: str | Callable[[Evidence], str]
    timed: bool = False


def verdict(holds: bool) -> Verdict:
    return Verdict.HOLDS if holds else Verdict.DIFFERS


def resolve(interval: Interval, published: float, none: float = 0.0) -> Verdict:
    """Whether an interval shows an effect with the sign of the published one; ``none`` is no effect."""
    if interval.low <= none <= interval.high:
        seen = interval.low <= published <= interval.high
        return Verdict.UNRESOLVED if seen else Verdict.DIFFERS
    return verdict((interval.low > none) == (published > none))


def same(interval: Interval, margin: float, centre: float = 0.0) -> Verdict:
    """Whether an interval lies within a margin about ``centre``, outside of it, or reaches over its limit."""
    if interval.within(margin, centre):
        return Verdict.HOLDS
    outside = interval.low >= centre + margin or interval.high <= centre - margin
    return Verdict.DIFFERS if outside else Verdict.UNRESOLVED


def together(verdicts: Iterable[Verdict]) -> Verdict:
    """Of a claim with several parts: the worst."""
    found = set(verdicts)
    return next(v for v in (Verdict.DIFFERS, Verdict.UNRESOLVED, Verdict.HOLDS) if v in found)


def on_euroc(e: Evidence, text: str, found: Verdict) -> Finding:
    """A finding on the paper's image sequences; on others it is shown, and nothing is concluded."""
    if e.source == "euroc":
        return text, found
    where = STAND_IN if e.source == "rendered" else "not the sequences of the paper"
    return f"{text} ({where})", Verdict.UNTESTED


def spread(values: list[float], digits: str = ".3f") -> str:
    """'smallest to largest'."""
    return f"{min(values):{digits}} to {max(values):{digits}}"
