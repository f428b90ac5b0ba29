"""A claim of the paper, and what several claims share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..experiments.evidence import Evidence
from ..ids import STAND_IN

Finding = tuple[str, bool | None]


@dataclass(frozen=True)
class Claim:
    """One statement of the paper and how it is judged.

    ``evidence`` names what shows it: tables, figures, and tables of the explaining experiments.
    ``judge`` returns what was measured and whether the criterion holds, None for the latter where the
    evidence cannot tell. ``why``: the experiment that explains the outcome, in a sentence with its numbers.
    """

    id: str
    evidence: tuple[str, ...]
    section: str
    claim: str
    published: str
    criterion: str
    judge: Callable[[Evidence], Finding]
    why: Callable[[Evidence], str] | None = None


def on_euroc(e: Evidence, text: str, holds: bool) -> Finding:
    """A finding on the paper's image sequences; on others it is shown, and nothing is concluded."""
    if e.source == "euroc":
        return text, holds
    return f"{text} ({STAND_IN if e.source == 'rendered' else 'not the sequences of the paper'})", None


def spread(values: list[float], digits: str = ".3f") -> str:
    """'smallest to largest'."""
    return f"{min(values):{digits}} to {max(values):{digits}}"
