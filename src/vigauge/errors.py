"""The errors that bad input raises: one family, one message form."""

from __future__ import annotations

import reprlib
from os import PathLike
from typing import Any

# What was found is quoted, not copied: a hostile value may be of any size.
_QUOTE = reprlib.Repr()
_QUOTE.maxlevel = 4
_QUOTE.maxlist = _QUOTE.maxtuple = _QUOTE.maxdict = _QUOTE.maxset = 16
_QUOTE.maxstring = _QUOTE.maxother = 200
_LONGEST_PART = 1000


def _shortened(text: str) -> str:
    return text if len(text) <= _LONGEST_PART else text[:_LONGEST_PART] + "..."


def _quoted(value: object) -> str:
    try:
        return _QUOTE.repr(value)
    except ValueError:  # an integer of more digits than Python prints
        return f"a {type(value).__name__}"


class VigaugeError(Exception):
    """Base of every error that the package raises on purpose."""


class DataError(VigaugeError):
    """Bad input data: names the file, where in it, the value, and the rule it breaks.

    Parameters
    ----------
    file : path of the offending file, or a short name of the array for data from memory
    rule : what must hold, in words ("timestamps must increase")
    row : 1-based line of a text file, or index along the first axis of an array
    field : column, key or attribute
    value : what was found there
    """

    def __init__(
        self,
        file: str | PathLike[str],
        rule: str,
        *,
        row: int | None = None,
        field: str | None = None,
        value: object = None,
    ) -> None:
        self.file = str(file)
        self.rule = rule
        self.row = row
        self.field = field
        self.value = value
        where = self.file
        if row is not None:
            where += f", row {row}"
        if field is not None:
            where += f", {_shortened(field)}"
        found = "" if value is None else f" (found {_quoted(value)})"
        super().__init__(f"{where}: {_shortened(rule)}{found}")

    def __reduce__(self) -> tuple[Any, ...]:
        # Exceptions pickle their message only; this keeps the parts (worker processes).
        return _rebuild, (type(self), self.file, self.rule, self.row, self.field, self.value)


def _rebuild(
    kind: type[DataError], file: str, rule: str, row: int | None, field: str | None, value: object
) -> DataError:
    return kind(file, rule, row=row, field=field, value=value)


class ConfigError(DataError):
    """A configuration key that is missing, unknown or out of range."""


class MixtureError(DataError):
    """Results of different configurations, versions or runs that were about to be put together."""


class OutputError(VigaugeError):
    """A result that could not be written: full disk, no permission, file too large. Nothing was changed."""


class FetchError(DataError):
    """A file that a host did not give, or not whole, or another one than it should be."""


class SolverError(VigaugeError):
    """The optimiser could not go on (non-finite cost, singular system)."""


class DegenerateError(SolverError):
    """More directions are unobservable than the gauge explains; no covariance is given.

    ``parameters`` are the columns that such a direction is mostly of, where that is known.
    """

    def __init__(self, message: str, *, parameters: tuple[int, ...] = ()) -> None:
        super().__init__(message)
        self.parameters = parameters


class IndefiniteError(DegenerateError):
    """An information matrix with a negative eigenvalue, which no sum of squares has."""


class MissingExtraError(VigaugeError, ImportError):
    """A part of the library that needs packages which are not installed."""
