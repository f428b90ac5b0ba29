"""What a check of a sequence found: facts, warnings, errors, and the exit status that follows."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

ERROR, WARNING = "error", "warning"


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong or odd: "error" or "warning", the check that saw it, a sentence."""

    severity: str
    check: str
    message: str


@dataclass
class Findings:
    """Everything that was found about one sequence."""

    sequence: str  # name of its folder
    # Measured numbers by topic; None where something could not be measured.
    facts: dict[str, Any] = field(default_factory=dict)
    found: list[Finding] = field(default_factory=list)  # warnings and errors in the order of the checks
    skipped: dict[str, str] = field(default_factory=dict)  # checks that could not be made, and why

    def error(self, check: str, message: str) -> None:
        """The sequence cannot be used as it is."""
        self.found.append(Finding(ERROR, check, message))

    def warn(self, check: str, message: str) -> None:
        """The sequence can be used, but somebody should know."""
        self.found.append(Finding(WARNING, check, message))

    def skip(self, check: str, reason: str) -> None:
        """A check that was not made."""
        self.skipped[check] = reason

    def fact(self, topic: str, **numbers: Any) -> None:
        """Add numbers to a topic; NaN and infinity become None."""
        self.facts.setdefault(topic, {}).update({name: _plain(value) for name, value in numbers.items()})

    def of(self, severity: str) -> list[Finding]:
        """Findings of one severity."""
        return [finding for finding in self.found if finding.severity == severity]

    @property
    def exit_status(self) -> int:
        """0 nothing to say, 1 warnings, 2 errors: unusable."""
        return 2 if self.of(ERROR) else 1 if self.of(WARNING) else 0

    def to_mapping(self) -> dict[str, Any]:
        """Plain numbers, lists and dictionaries, for JSON."""
        return {
            "sequence": self.sequence,
            "exit_status": self.exit_status,
            "facts": self.facts,
            "errors": [{"check": f.check, "message": f.message} for f in self.of(ERROR)],
            "warnings": [{"check": f.check, "message": f.message} for f in self.of(WARNING)],
            "skipped": self.skipped,
        }

    def lines(self) -> list[str]:
        """The same for people: a line a topic, then what was skipped, warnings, errors."""
        out = [f"{self.sequence}"]
        for topic, numbers in self.facts.items():
            parts = [f"{name} {_text(value)}" for name, value in numbers.items()]
            out.append(f"  {topic}: " + ", ".join(parts))
        out += [f"  not checked: {check} ({reason})" for check, reason in self.skipped.items()]
        out += [f"  {f.severity} [{f.check}]: {f.message}" for f in self.of(WARNING) + self.of(ERROR)]
        verdict = ("nothing wrong found", "usable, with warnings", "unusable")[self.exit_status]
        return [*out, f"  {verdict}"]


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return [_plain(entry) for entry in value.tolist()]
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


def _text(value: Any) -> str:
    if value is None:
        return "unknown"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return "[" + ", ".join(_text(entry) for entry in value) + "]"
    return str(value)
