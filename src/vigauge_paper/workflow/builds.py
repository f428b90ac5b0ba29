"""Whose sequences the results in paper_figures/ show: no build replaces the other source's in silence."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vigauge.errors import DataError
from vigauge.files import write_json

_WORDS = {
    "euroc": "the paper's EuRoC sequences",
    "rendered": "rendered stand-ins",
    "other": "other recordings",
}


@dataclass(frozen=True)
class Builds:
    """What each result that is there was made from (``shown``, by file), and what ``this`` build takes.

    A build is its source of sequences, what the ledger takes them for, and whether the paper's
    numbers stand beside them. ``may_replace`` allows results of another source to go.
    """

    record: Path
    shown: Mapping[str, Mapping[str, Any]]
    this: Mapping[str, Any]
    may_replace: bool

    @classmethod
    def read(cls, record: Path, this: Mapping[str, Any], may_replace: bool) -> Builds:
        """The record, without files that are gone; DataError where it is none."""
        if not record.is_file():
            return cls(record, {}, this, may_replace)
        try:
            found = json.loads(record.read_text("utf-8"))
            wrong = [file for file, build in found.items() if build["claims"] not in _WORDS]
        except (ValueError, AttributeError, TypeError, KeyError) as error:
            wrong = [str(error)]
        if wrong:
            raise DataError(record, f"must be the record of a build ({wrong[0]}); delete {record.parent}/")
        there = {file: build for file, build in found.items() if Path(file).exists()}
        return cls(record, there, this, may_replace)

    def conflict(self, files: Iterable[str], run: str) -> str:
        """What stands there, what a run takes, how to choose, in words; empty where they are the same."""
        other = [f for f in files if f in self.shown and self.shown[f]["claims"] != self.this["claims"]]
        if self.may_replace or not other:
            return ""
        theirs = " and ".join(sorted({_WORDS[self.shown[file]["claims"]] for file in other}))
        return (
            f"{len(other)} file(s) of {self.record.parent}/ show {theirs}, and {run} would replace them by"
            f" {_WORDS[self.this['claims']]}: set EUROC_ROOT (or euroc.root) as in the build before, make"
            " this one elsewhere with --directory, or let those go with --config replace_other_source=True"
        )

    def extensions(self, made: Mapping[str, str]) -> list[str]:
        """NAME=FILE of what is made only when asked for, by name, where it shows this build's sequences."""
        claims = {name: self.shown.get(file, {}).get("claims") for name, file in made.items()}
        return [f"{name}={file}" for name, file in made.items() if claims[name] == self.this["claims"]]

    def begin(self, files: list[str]) -> None:
        """Enter the files that a run makes, and take away what it replaces.

        So a run that breaks off leaves no file whose record is wrong.
        """
        for file in files:
            if self.shown.get(file, self.this) != self.this:
                Path(file).unlink()
        if files:
            self.record.parent.mkdir(parents=True, exist_ok=True)
            write_json(self.record, {**self.shown, **dict.fromkeys(files, self.this)})
