"""The table of addresses, ``data/euroc_sources.csv``: the only place that names a host.

A row describes one file. Several rows of a sequence are mirrors; they are tried in order. An
address may end in ``#path/inside.zip``: the sequence's zip is then that member of a bundle, and
``bytes`` and ``sha256`` describe the member. The row with the same address and no ``#`` describes
the bundle. Both columns may be empty where nobody has published the values.
"""

import csv
import re
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote, urldefrag, urlsplit

from vigauge.errors import DataError

COLUMNS = ("sequence", "host", "url", "bytes", "sha256", "note")
_NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.-]*")
_SHA256 = re.compile(r"([0-9a-f]{64})?")
_BYTES = re.compile(r"([1-9][0-9]{0,15})?")


@dataclass(frozen=True)
class Source:
    """One row: the address of a sequence's zip, or of a bundle."""

    name: str  # sequence or bundle
    host: str  # name of the host, for messages
    url: str  # http or https address of a file, without the part after ``#``
    member: str | None  # path inside the bundle at ``url``; None where ``url`` is the zip itself
    size: int | None  # bytes of the zip; None where unknown
    sha256: str | None  # of the zip, lower-case hexadecimal; None where unknown
    note: str  # for people

    def __str__(self) -> str:
        return f"{self.url}#{self.member}" if self.member else self.url


def read_sources(path: Path) -> list[Source]:
    """All rows of the table, in order; DataError names the row, field and rule of a wrong one."""
    try:
        with Path(path).open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.DictReader(stream, strict=True)
            if tuple(reader.fieldnames or ()) != COLUMNS:
                raise DataError(path, f"columns must be {', '.join(COLUMNS)}", row=1, value=reader.fieldnames)
            return [_source(path, reader.line_num, row) for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DataError(path, f"must be a readable table of sources: {error}") from error


def sources_of(sources: list[Source], sequence: str, path: Path) -> list[Source]:
    """The rows of one sequence; DataError where the table ``path`` has none."""
    found = [source for source in sources if source.name == sequence]
    if not found:
        known = ", ".join(dict.fromkeys(source.name for source in sources))
        raise DataError(
            path, f"must have a row of the sequence; it has {known}", field="sequence", value=sequence
        )
    return found


def bundle_of(sources: list[Source], source: Source) -> Source | None:
    """The row of the bundle that ``source`` is a member of, if the table has it."""
    return next((row for row in sources if row.url == source.url and row.member is None), None)


def _source(path: Path, line: int, row: dict[str, str]) -> Source:
    if None in row or None in row.values():
        raise DataError(path, f"must have {len(COLUMNS)} columns", row=line)
    try:
        url, member = urldefrag(row["url"])
        parts = urlsplit(url)
        is_address = parts.scheme in ("http", "https") and bool(parts.hostname)
    except ValueError:
        is_address = False
    for field, holds, rule in (
        ("sequence", _NAME.fullmatch(row["sequence"]), "must be a plain name"),
        ("url", is_address, "must be an http or https address"),
        ("bytes", _BYTES.fullmatch(row["bytes"]), "must be a positive integer or empty"),
        ("sha256", _SHA256.fullmatch(row["sha256"]), "must be 64 hex digits or empty"),
    ):
        if not holds:
            raise DataError(path, rule, row=line, field=field, value=row[field])
    return Source(
        name=row["sequence"],
        host=row["host"],
        url=url,
        member=unquote(member) or None,
        size=int(row["bytes"]) if row["bytes"] else None,
        sha256=row["sha256"] or None,
        note=row["note"],
    )
