"""Numbers of text files: read, or refused with file, line and rule."""

from __future__ import annotations

import math
import os
from decimal import Decimal, InvalidOperation
from pathlib import Path

from ..arrays import LARGEST
from ..errors import DataError

PathLike = str | os.PathLike[str]

# Files of other tools keep four digits of a quaternion or more.
_UNIT = 1e-3


def read_text(path: PathLike) -> str:
    """The text of a file in UTF-8; DataError where it is missing or not that."""
    if not Path(path).is_file():
        raise DataError(path, "file must exist")
    try:
        return Path(path).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise DataError(path, f"must be text in UTF-8: {error}") from error


def number_in(path: PathLike, line: int, cell: str, field: str | None = None) -> float:
    """A finite number below 1e100; DataError otherwise."""
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or "_" in cell:
        raise DataError(path, "must be a finite number", row=line, field=field, value=cell)
    if abs(value) >= LARGEST:
        raise DataError(path, f"must be below {LARGEST:.0e} in size", row=line, field=field, value=cell)
    return value


def require_unit(path: PathLike, line: int, quaternion: list[float]) -> None:
    """DataError where a quaternion has not length 1, to the digits that files have."""
    length = math.hypot(*quaternion)
    if abs(length - 1.0) > _UNIT:
        raise DataError(path, "quaternion qx qy qz qw must have length 1", row=line, value=length)


def nanoseconds_in(path: PathLike, line: int, cell: str) -> int:
    """Seconds as text in integer nanoseconds, to the nearest."""
    rule = "must be a time in seconds, below 292 years"
    # The size first: of 1e999999 an integer of a million digits would be made.
    if abs(number_in(path, line, cell, "t")) >= 2**63 // 10**9:
        raise DataError(path, rule, row=line, field="t", value=cell)
    try:
        return int(Decimal(cell).scaleb(9).to_integral_value())
    except InvalidOperation as error:
        raise DataError(path, rule, row=line, field="t", value=cell) from error


def integer_in(path: PathLike, line: int, cell: str, field: str = "t_ns") -> int:
    """Integer nanoseconds; DataError otherwise."""
    digits = cell.removeprefix("-")
    if not (digits.isascii() and digits.isdigit() and len(digits) < 20 and int(digits) < 2**63):
        raise DataError(path, "must be integer nanoseconds", row=line, field=field, value=cell)
    return int(cell)


def require_after(path: PathLike, line: int, times: list[int]) -> None:
    """DataError where the last of the times does not follow the one before."""
    if len(times) > 1 and times[-1] <= times[-2]:
        raise DataError(path, f"times must increase: {times[-2]} ns precedes", row=line, value=times[-1])
