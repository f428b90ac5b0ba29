"""What results in paper_figures/ were made from: none of another source or more trials goes in silence."""

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

    A build is its number of simulated trials and, for results that show sequences, their source, what the
    ledger takes them for, and whether the paper's numbers stand beside them. ``may_replace`` allows
    results of another source or of more trials to go.
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
            wrong = [file for file, build in found.items() if not _is_build(build)]
        except (ValueError, AttributeError, TypeError, KeyError) as error:
            wrong = [str(error)]
        if wrong:
            raise DataError(record, f"must be the record of a build ({wrong[0]}); delete {record.parent}/")
        there = {file: build for file, build in found.items() if Path(file).exists()}
        return cls(record, there, this, may_replace)

    def conflict(self, files: Iterable[str], run: str) -> str:
        """What stands there, what a run takes, how to choose, in words; empty where nothing is lost."""
        there = [self.shown[file] for file in files if file in self.shown and not self.may_replace]
        claims, trials = self.this["claims"], self.this["trials"]
        other = [build["claims"] for build in there if build.get("claims", claims) != claims]
        more = [build["trials"] for build in there if build.get("trials", 0) > trials]
        if other:
            theirs = f"show {' and '.join(sorted({_WORDS[source] for source in other}))}"
            ours = f"{_WORDS[claims]}: set EUROC_ROOT (or euroc.root) as in the build before,"
        elif more:
            theirs, ours = f"are of {max(more)} trials", f"those of {trials}:"
        else:
            return ""
        return (
            f"{len(other or more)} file(s) of {self.record.parent}/ {theirs}, and {run} would replace them by"
            f" {ours} make this one elsewhere with --directory FOLDER, or let those go with"
            " --config replace_other_source=True"
        )

    def extensions(self, made: Mapping[str, str]) -> list[str]:
        """NAME=FILE of what is made only when asked for, by name, where it shows this build's sequences."""
        claims = {name: self.shown.get(file, {}).get("claims") for name, file in made.items()}
        return [f"{name}={file}" for name, file in made.items() if claims[name] == self.this["claims"]]

    def begin(self, files: Mapping[str, bool]) -> None:
        """Enter the files that a run makes, and whether each shows sequences; take away what it replaces.

        So a run that breaks off leaves no file whose record is wrong.
        """
        simulated = {"trials": self.this["trials"]}
        builds = {file: self.this if shows else simulated for file, shows in files.items()}
        for file, build in builds.items():
            if self.shown.get(file, build) != build:
                Path(file).unlink()
        if builds:
            self.record.parent.mkdir(parents=True, exist_ok=True)
            write_json(self.record, {**self.shown, **builds})


def _is_build(build: Mapping[str, Any]) -> bool:
    return isinstance(build.get("trials", 0), int) and (
        build.get("claims") in _WORDS or set(build) == {"trials"}
    )
