"""Stamps: what a result was made from, written beside it; results that do not belong together are refused.

A stamp belongs to one job. Two stamps agree if they have the same value for every section of
the configuration that both depend on, if those of one stage come from the same code and
packages, and if each was made from the inputs that are there.
"""

import hashlib
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from vigauge.cli.command import LOG
from vigauge.errors import DataError, MixtureError
from vigauge.files import write_json


@dataclass(frozen=True)
class Stamp:
    """What one job made, from what."""

    stage: str  # name of the command
    # Of the package; sha256 of the source files that the stage loaded.
    version: str
    code: str
    packages: Mapping[str, str]  # versions of Python and of the packages that numbers depend on
    config: Mapping[str, Any]  # the sections of the configuration that the job depends on, and no others
    labels: Mapping[str, Any]  # settings of this job alone (configuration, sequence, noise model, ...)
    seeds: tuple[int, ...]  # random seeds of the job and of everything that it was made from
    # Identities of the stamps of what it read, by file relative to this stamp's folder.
    inputs: Mapping[str, str]
    sources: Mapping[str, str]  # sha256 of files from outside the workflow, by name
    # The sha256 of files made, by file; ``timings`` differ from run to run.
    outputs: Mapping[str, str]
    timings: Mapping[str, str]

    @property
    def identity(self) -> str:
        """sha256 of everything but the timings: a repeated run has the same identity."""
        return digest_of(asdict(self) | {"timings": None})


def digest_of(value: object) -> str:
    """sha256 of a value as canonical JSON."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def digest_file(path: Path) -> str:
    """sha256 of a file, or of the names and contents of a folder without Snakemake's hidden files."""
    if not path.is_dir():
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    files = sorted(file for file in path.rglob("*") if file.is_file() and not file.name.startswith("."))
    return digest_of([(file.relative_to(path).as_posix(), digest_file(file)) for file in files])


def digests(files: Iterable[Path], folder: Path) -> dict[str, str]:
    """sha256 of files by their path relative to a folder."""
    return {Path(os.path.relpath(file, folder)).as_posix(): digest_file(file) for file in sorted(files)}


def code_digest(files: Iterable[Path]) -> str:
    """sha256 of source files, whatever folder they lie in."""
    return digest_of(sorted((file.name, digest_file(file)) for file in files))


def write_stamp(path: Path, stamp: Stamp) -> None:
    """Write a stamp as JSON, all or nothing."""
    write_json(path, asdict(stamp))


def read_stamp(path: Path) -> Stamp:
    """Read what :func:`write_stamp` wrote; DataError where it is missing or no stamp."""
    if not path.is_file():
        raise DataError(path, "stamp of the result must exist; delete the result and make it again")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        stamp = Stamp(**content | {"seeds": tuple(content["seeds"])})
        for name in ("config", "inputs", "outputs", "timings"):
            if not isinstance(content[name], dict):
                raise TypeError(f"{name} is no object")
    except (ValueError, TypeError, KeyError) as error:
        raise DataError(path, f"must be the stamp of a result: {error}") from error
    return stamp


def made_with(stamps: Sequence[Path], stamp: Path, name: str) -> bool:
    """Whether what is only made when asked for (a sweep, a spread) is of these results; if not, a warning."""
    try:
        require_coherent([*stamps, stamp])
    except MixtureError as error:
        LOG.warning("%s left out; make it again: %s", name, error)
        return False
    return True


def require_coherent(paths: Sequence[Path]) -> dict[Path, Stamp]:
    """The stamps of results and of all that they were made from, if they belong together.

    Raises MixtureError where a result was changed after it was stamped, where its inputs were made anew, or
    where two were made under different configuration, code or packages. DataError where a stamp is missing or
    unreadable.
    """
    stamps: dict[Path, Stamp] = {}
    for path in paths:
        _collect(path, stamps)
        for name, digest in {**stamps[path].outputs, **stamps[path].timings}.items():
            file = path.parent / name
            if file.exists() and digest_file(file) != digest:
                rule = f"is not the result that {path} was written for; delete it and make it again"
                raise MixtureError(file, rule)
    first: dict[tuple[str, str], tuple[Path, Any]] = {}
    for path, stamp in stamps.items():
        made = {"version": stamp.version, "code": stamp.code, "packages": stamp.packages}
        shared = {("configuration", key): value for key, value in stamp.config.items()}
        for key, value in (shared | {(stamp.stage, key): value for key, value in made.items()}).items():
            other, expected = first.setdefault(key, (path, value))
            if value != expected:
                raise _mixture(path, other, key[1], value, expected)
    return stamps


def _collect(path: Path, stamps: dict[Path, Stamp]) -> None:
    """Read a stamp and those of its inputs; intermediate results may have been deleted."""
    if path in stamps:
        return
    stamp = stamps[path] = read_stamp(path)
    for name, identity in stamp.inputs.items():
        source = Path(os.path.normpath(path.parent / name))
        if source.is_file():
            _collect(source, stamps)
            if stamps[source].identity != identity:
                repair = "delete what lies beside it and make it again"
                raise MixtureError(path, f"was made from another result than {source}; {repair}")


def _mixture(path: Path, other: Path, key: str, value: Any, expected: Any) -> MixtureError:
    """Names the innermost key that differs, and what to do."""
    while isinstance(value, dict) and isinstance(expected, dict):
        name = next(k for k in sorted({*value, *expected}) if value.get(k) != expected.get(k))
        key, value, expected = f"{key}.{name}", value.get(name), expected.get(name)
    repair = "results of two runs are mixed, delete one and make it again"
    rule = f"must be that of {other}, which has {expected!r}; {repair}"
    return MixtureError(path, rule, field=key, value=value)
