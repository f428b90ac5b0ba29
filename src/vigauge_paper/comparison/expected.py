"""Expected numbers of the artefacts, with the tolerance of each: does another build match?"""

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from vigauge.errors import DataError

SIMULATION, EUROC, RENDERED = SOURCES = ("simulation", "euroc", "rendered")

# How two values are compared. FACTOR: the greater is at most 1 + tolerance of the
# smaller. LIMIT: what is found stays within the tolerance, whatever was expected.
SAME, ABSOLUTE, RELATIVE, FACTOR, LIMIT = KINDS = ("same", "absolute", "relative", "factor", "limit")

RENEW = "where the change is meant, renew the expected values with --write"


@dataclass(frozen=True)
class Value:
    """A number, or a word (kind 'same'), of an artefact, and how near another build's must come.

    ``source`` is 'simulation', or whose sequences are shown: 'euroc' or 'rendered'. ``row`` holds the
    labels of the row, joined by blanks.
    """

    artefact: str
    source: str
    row: str
    quantity: str
    value: float | str
    tolerance: float
    kind: str

    @property
    def key(self) -> tuple[str, ...]:
        return self.artefact, self.source, self.row, self.quantity

    def deviation(self, found: float | str) -> float:
        """Of what was found, in the unit of the tolerance; infinite where words differ."""
        if isinstance(found, str) or isinstance(self.value, str):
            return 0.0 if found == self.value else math.inf
        if self.kind == LIMIT:
            return abs(found)
        if self.kind == FACTOR:
            low, high = sorted((found, self.value))
            return high / low - 1.0 if low > 0.0 else math.inf
        distance = abs(found - self.value)
        if self.kind == ABSOLUTE or distance == 0.0:
            return distance
        return distance / abs(self.value) if self.value else math.inf


@dataclass(frozen=True)
class Match:
    """An expected value and what another build has in its place."""

    expected: Value
    found: float | str

    @property
    def deviation(self) -> float:
        return self.expected.deviation(self.found)

    @property
    def ok(self) -> bool:
        return self.deviation <= self.expected.tolerance

    @property
    def share(self) -> float:
        """Deviation over tolerance: comparable between kinds, at most 1 where the two match."""
        if self.deviation == 0.0:
            return 0.0
        return self.deviation / self.expected.tolerance if self.expected.tolerance else math.inf


def matches(expected: Sequence[Value], found: Sequence[Value]) -> list[Match]:
    """Pairs of what was expected and found; DataError where a row has no partner.

    Expected values of sequences that are not shown are left out.
    """
    shown = {(value.artefact, value.source) for value in found}
    wanted = {v.key: v for v in expected if v.source == SIMULATION or (v.artefact, v.source) in shown}
    there = {value.key: value for value in found}
    for keys, partners, rule in ((wanted, there, "is missing"), (there, wanted, "has no expected value")):
        for key in keys:
            if key not in partners:
                artefact, source, row, quantity = key
                raise DataError(artefact, f"{rule}; {RENEW}", field=f"{row}, {quantity} ({source})")
    return [Match(value, there[key].value) for key, value in wanted.items()]


def renewed(expected: Sequence[Value], found: Sequence[Value]) -> list[Value]:
    """What was found, and the expected values of artefacts from sources that are not shown."""
    shown = {(value.artefact, value.source) for value in found}
    kept = [value for value in expected if (value.artefact, value.source) not in shown]
    order = list(dict.fromkeys(value.artefact for value in (*found, *kept)))
    return sorted([*found, *kept], key=lambda v: (order.index(v.artefact), SOURCES.index(v.source)))


def read_expected(file: Path) -> list[Value]:
    """Expected values from CSV; DataError where one is no value of a known kind, or stands twice."""
    out: dict[tuple[str, ...], Value] = {}
    for line, row in enumerate(rows_of(file, [field.name for field in fields(Value)]), start=2):
        for field, known in (("kind", KINDS), ("source", SOURCES)):
            if row[field] not in known:
                rule = f"must be one of {', '.join(known)}"
                raise DataError(file, rule, row=line, field=field, value=row[field])
        tolerance = number(row["tolerance"], file, "tolerance", line)
        value = row["value"] if row["kind"] == SAME else number(row["value"], file, "value", line)
        labels = row["artefact"], row["source"], row["row"], row["quantity"]
        entry = Value(*labels, value=value, tolerance=tolerance, kind=row["kind"])
        if entry.key in out:
            raise DataError(file, "must stand once", row=line, value=", ".join(entry.key))
        out[entry.key] = entry
    return list(out.values())


def rows_of(file: Path, columns: Sequence[str]) -> list[dict[str, str]]:
    """These columns of a CSV file, row by row; DataError where it or one of them is missing."""
    try:
        with file.open(encoding="utf-8", newline="") as stream:
            reader = csv.DictReader(stream, restval="")
            rows, names = list(reader), reader.fieldnames or []
    except FileNotFoundError as error:
        raise missing(file) from error
    except (ValueError, csv.Error) as error:
        raise DataError(file, f"must be CSV: {error}") from error
    if not rows:
        raise DataError(file, "must have rows")
    for column in columns:
        if column not in names:
            raise DataError(file, "must be a column", field=column, value=", ".join(names))
    return [{column: row[column] for column in columns} for row in rows]


def missing(file: Path) -> DataError:
    """The error for a file that is not there."""
    return DataError(file, "must exist; `make paper` makes results, --write expected values")


def number(text: object, file: Path, column: str, line: int | None = None) -> float:
    """A finite number of a file; DataError where it is none."""
    try:
        value = float(str(text))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise DataError(file, "must be a finite number", row=line, field=column, value=text)
    return value
