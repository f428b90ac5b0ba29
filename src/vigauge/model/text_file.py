"""Numbers of text files: read, or refused with file, line and rule."""

from __future__ import annotations

import math
import os
from pathlib import Path

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
    """A finite number; DataError otherwise."""
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or "_" in cell:
        raise DataError(path, "must be a finite number", row=line, field=field, value=cell)
    return value


def require_unit(path: PathLike, line: int, quaternion: list[float]) -> None:
    """DataError where a quaternion has not length 1, to the digits that files have."""
    length = math.hypot(*quaternion)
    if abs(length - 1.0) > _UNIT:
        raise DataError(path, "quaternion qx qy qz qw must have length 1", row=line, value=length)
