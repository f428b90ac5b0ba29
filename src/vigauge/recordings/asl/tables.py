"""The ``data.csv`` of ASL folders: a stamp in nanoseconds, then columns; read strictly.

Stamps go from text to int64 without a float in between, which would round them to
multiples of 256 ns. Byte-order marks, CRLF line ends and blank lines are let pass;
everything else that is odd raises DataError with the line of the file.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import DataError
from ...geometry.so3 import Array

_INTEGER = re.compile(r"[0-9]{1,19}")
_DECIMAL = re.compile(r"[0-9]+\.[0-9]*([eE][+-]?[0-9]+)?|[0-9]+[eE][+-]?[0-9]+")
# One way to match only: with two, a long row of digits takes time by its square.
_NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?")
_LARGEST_NS = int(np.iinfo(np.int64).max)

# Clocks start anywhere, so a stamp alone says little: 2e15 is 2033 in microseconds, and three weeks after
# power-on in nanoseconds. Stamps of a date in another unit are of that unit where they would follow each
# other faster than those of any sensor if they were nanoseconds.
_YEAR_2000_S, _YEAR_2100_S = 946_684_800, 4_102_444_800
# Images come 250 times a second at most, samples of other sensors 2500 times.
_FASTEST_IMAGES_NS, FASTEST_SAMPLES_NS = 4_000_000, 400_000
_UNITS = (("s", 1), ("ms", 10**3), ("us", 10**6))
# Stamp, line and other fields of a row.
_Stamped = tuple[int, int, tuple[str, ...]]


@dataclass(frozen=True)
class Table:
    """The rows of one file, in order of time."""

    path: Path  # the file, for messages
    columns: tuple[str, ...]  # names from the header, without ``#``; empty where there is no header
    lines: NDArray[np.int64]  # (M,) 1-based line of the file each row came from
    t_ns: NDArray[np.int64]  # (M,) int64 stamps, strictly increasing
    fields: tuple[tuple[str, ...], ...]  # the text of the columns after the stamp, one tuple a row
    n_repeated: int  # rows left out because they repeat the row before them letter by letter
    n_unsorted: int = 0  # rows of the file with an earlier stamp than the row before them

    def numbers(self) -> Array:
        """(M, columns - 1) finite numbers after the stamp; DataError names line and column."""
        if all(_is_finite(text) for row in self.fields for text in row):
            return np.array(self.fields, dtype=float)
        for line, row in zip(self.lines, self.fields, strict=True):
            for k, text in enumerate(row):
                if not _is_finite(text):
                    name = self.columns[k + 1] if k + 1 < len(self.columns) else f"column {k + 2}"
                    raise DataError(
                        self.path, "must be a finite number", row=int(line), field=name, value=text
                    )
        raise AssertionError("unreachable: every field is a finite number")


def _is_finite(text: str) -> bool:
    """Whether the text is a plain decimal number; ``float`` alone would take ``1_0`` and ``nan``."""
    return _NUMBER.fullmatch(text) is not None and isfinite(float(text))


def read_table(
    path: Path,
    widths: Collection[int],
    *,
    drop_repeated: bool = False,
    sort: bool = False,
    fastest_ns: int = _FASTEST_IMAGES_NS,
) -> Table:
    """Read a ``data.csv`` whose rows have one of the allowed ``widths``, stamp included.

    ``drop_repeated`` leaves out rows equal to the row before them and counts them; without
    it, and for equal stamps on different rows, a repeated stamp is an error. ``sort`` puts
    rows in order of their stamps and counts those that were not; without it they are an error.
    ``fastest_ns`` is the least spacing of stamps that can be nanoseconds.

    Raises DataError for a file that is missing, not text, or without rows; a row of another width than the
    first; a stamp that is no integer, not in nanoseconds, repeated or out of order.
    """
    columns, rows = _split(path)
    if not rows:
        raise DataError(path, "must have at least one row of data")
    width = len(rows[0][1])
    if width not in widths:
        allowed = " or ".join(str(w) for w in sorted(widths))
        raise DataError(path, f"must have {allowed} columns", row=rows[0][0], value=width)
    stamped: list[_Stamped] = []
    n_unsorted = 0
    for line, row in rows:
        if len(row) != width:
            raise DataError(path, f"must have {width} columns like the first row", row=line, value=len(row))
        stamp = _stamp(path, line, row[0])
        n_unsorted += bool(stamped) and stamp < stamped[-1][0]
        stamped.append((stamp, line, tuple(row[1:])))
    if sort:
        stamped.sort(key=lambda entry: entry[0])
    kept = _increasing(path, stamped, drop_repeated)
    stamps, lines, fields = zip(*kept, strict=True)
    t_ns = np.array(stamps, dtype=np.int64)
    _require_nanoseconds(path, lines[0], t_ns, fastest_ns)
    return Table(path, columns, np.array(lines), t_ns, fields, len(stamped) - len(kept), n_unsorted)


def _increasing(path: Path, rows: list[_Stamped], drop_repeated: bool) -> list[_Stamped]:
    """The rows with the stamps of none before; DataError for those that may not be left out."""
    kept = rows[:1]
    for stamp, line, values in rows[1:]:
        last, _, same = kept[-1]
        if stamp < last:
            raise DataError(path, "timestamps must increase", row=line, field="timestamp", value=stamp)
        if stamp > last:
            kept.append((stamp, line, values))
        elif not drop_repeated or values != same:
            rule = "timestamps must not repeat" + (" with other values" if drop_repeated else "")
            raise DataError(path, rule, row=line, field="timestamp", value=stamp)
    return kept


def _split(path: Path) -> tuple[tuple[str, ...], list[tuple[int, list[str]]]]:
    """Header names and (line, fields) of every row."""
    if not path.is_file():
        raise DataError(path, "file must exist")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (UnicodeDecodeError, OSError) as error:
        raise DataError(path, f"must be a readable UTF-8 text file: {error}") from error
    columns: tuple[str, ...] = ()
    rows: list[tuple[int, list[str]]] = []
    for line, content in enumerate(text.splitlines(), start=1):
        content = content.strip()
        if not content:
            continue
        row = [field.strip() for field in content.lstrip("#").split(",")]
        if content.startswith("#") or (not rows and not columns and "time" in row[0].lower()):
            columns = columns or tuple(row if row[-1] else row[:-1])
        elif len(row) > 1 and not row[-1]:
            raise DataError(path, "row must not end in a comma (is its last value missing?)", row=line)
        else:
            rows.append((line, row))
    return columns, rows


def _stamp(path: Path, line: int, text: str) -> int:
    if _INTEGER.fullmatch(text) and int(text) <= _LARGEST_NS:
        return int(text)
    hint = ""
    if _DECIMAL.fullmatch(text):
        hint = "; these look like seconds" if float(text) < 1e11 else "; a float has lost digits already"
    raise DataError(
        path,
        f"timestamp must be an integer number of nanoseconds{hint}",
        row=line,
        field="timestamp",
        value=text,
    )


def _require_nanoseconds(path: Path, line: int, t_ns: NDArray[np.int64], fastest_ns: int) -> None:
    first = int(t_ns[0])
    fast = len(t_ns) < 2 or float(np.median(np.diff(t_ns))) < fastest_ns
    for unit, per_second in _UNITS:
        if fast and _YEAR_2000_S * per_second <= first <= _YEAR_2100_S * per_second:
            raise DataError(
                path,
                f"timestamps must be in nanoseconds; these look like {unit}",
                row=line,
                field="timestamp",
                value=first,
            )
