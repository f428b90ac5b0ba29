"""The table of addresses, ``data/euroc_sources.csv``: the only place that names a host.

One row a file; several rows of a sequence are mirrors, tried in their order. An address
may end in ``#path/inside.zip``: the sequence's zip is then that member of a bundle, and
``bytes`` and ``sha256`` are the member's. A row with the bundle's own address, without
``#``, tells those of the bundle. Both may be empty where nobody has published them.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote, urldefrag, urlsplit

from vigauge.errors import DataError

COLUMNS = ("sequence", "host", "url", "bytes", "sha256", "note")
_NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.-]*")
_SHA256 = re.compile(r"[0-9a-f]{64}")
_BYTES = re.compile(r"[1-9][0-9]{0,15}")


@dataclass(frozen=True)
class Source:
    """One row: where the zip of a sequence (or a bundle) is.

    Attributes
    ----------
    name : sequence or bundle
    host : in words
    url : http or https address of a file, without the part after ``#``
    member : path inside the bundle at ``url``, or None where ``url`` is the zip itself
    size : bytes of the member, or of the file without one; None where unknown
    sha256 : of the same, lower-case hexadecimal; None where unknown
    note : for people
    """

    name: str
    host: str
    url: str
    member: str | None
    size: int | None
    sha256: str | None
    note: str

    def __str__(self) -> str:
        return f"{self.url}#{self.member}" if self.member else self.url


def read_sources(path: Path) -> list[Source]:
    """All rows of the table, in order; DataError names row, field and rule of one that is wrong."""
    try:
        with Path(path).open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.DictReader(stream, strict=True)
            if tuple(reader.fieldnames or ()) != COLUMNS:
                raise DataError(path, f"columns must be {', '.join(COLUMNS)}", row=1, value=reader.fieldnames)
            return [_source(path, reader.line_num, row) for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DataError(path, f"must be a readable table of sources: {error}") from error


def sources_of(sources: list[Source], sequence: str, path: Path) -> list[Source]:
    """The rows of one sequence; DataError where ``path`` has none."""
    found = [source for source in sources if source.name == sequence]
    if not found:
        known = ", ".join(dict.fromkeys(source.name for source in sources))
        raise DataError(
            path, f"must have a row of the sequence; it has {known}", field="sequence", value=sequence
        )
    return found


def bundle_of(sources: list[Source], source: Source) -> Source | None:
    """The row that tells size and checksum of the bundle that ``source`` is a member of."""
    return next((row for row in sources if row.url == source.url and row.member is None), None)


def _source(path: Path, line: int, row: dict[str, str]) -> Source:
    def require(holds: object, field: str, rule: str) -> None:
        if not holds:
            raise DataError(path, rule, row=line, field=field, value=row[field])

    if None in row or None in row.values():
        raise DataError(path, f"must have {len(COLUMNS)} columns", row=line)
    require(_NAME.fullmatch(row["sequence"]), "sequence", "must be a plain name")
    try:
        url, member = urldefrag(row["url"])
        parts = urlsplit(url)
    except ValueError as error:
        rule = f"must be an address: {error}"
        raise DataError(path, rule, row=line, field="url", value=row["url"]) from error
    require(parts.scheme in ("http", "https") and parts.hostname, "url", "must be an http or https address")
    require(
        not row["bytes"] or _BYTES.fullmatch(row["bytes"]), "bytes", "must be a positive integer or empty"
    )
    require(not row["sha256"] or _SHA256.fullmatch(row["sha256"]), "sha256", "must be 64 hex digits or empty")
    return Source(
        name=row["sequence"],
        host=row["host"],
        url=url,
        member=unquote(member) or None,
        size=int(row["bytes"]) if row["bytes"] else None,
        sha256=row["sha256"] or None,
        note=row["note"],
    )
