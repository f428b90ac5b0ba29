"""Stamps: what a result was made from, written beside it, and the refusal of mixtures.

A stamp belongs to one job. It holds the sections of the configuration that the job depends
on (and no others, so that an edit elsewhere leaves it valid), the labels of this job alone,
the code, package versions, seeds, the digests of what it wrote, and the identities of the
stamps of what it read. Results belong together if every section of the configuration that
two of them depend on is the same, if all of one stage come from the same code, and if each
was made from the inputs that are there.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from vigauge.errors import DataError, MixtureError
from vigauge.files import write_json


@dataclass(frozen=True)
class Stamp:
    """What one job made, from what.

    Attributes
    ----------
    stage : name of the command
    version, code : of the package; sha256 of the source files that the stage loaded
    packages : versions of Python and of the packages that numbers depend on
    config : sections of the configuration, by key; the same key has one value in all results
    config_sha256 : of ``config``
    labels : settings of this job alone (configuration, sequence, noise model, ...)
    seeds : random seeds of the job and of everything that it was made from
    inputs : stamp file, relative to this one's folder, to its identity
    sources : files from outside the workflow, by name, to their sha256
    outputs : files made, relative to the stamp's folder, to their sha256
    timings : likewise, of files that differ from run to run
    """

    stage: str
    version: str
    code: str
    packages: Mapping[str, str]
    config: Mapping[str, Any]
    config_sha256: str
    labels: Mapping[str, Any]
    seeds: tuple[int, ...]
    inputs: Mapping[str, str]
    sources: Mapping[str, str]
    outputs: Mapping[str, str]
    timings: Mapping[str, str]

    @property
    def identity(self) -> str:
        """sha256 of everything but the timings: two runs of the same give the same."""
        content = asdict(self)
        del content["timings"]
        return digest_of(content)


def digest_of(value: object) -> str:
    """sha256 of a value as canonical JSON."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def digest_file(path: Path) -> str:
    """sha256 of a file, or of the names and contents of a folder, hidden files apart.

    (Snakemake keeps the time of a folder in a hidden file of it.)
    """
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
    """Read what :func:`write_stamp` wrote; DataError where it is missing or none."""
    if not path.is_file():
        raise DataError(path, "stamp of the result must exist; delete the result and make it again")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        names = {field.name for field in fields(Stamp)}
        if not isinstance(content, dict) or set(content) != names:
            raise ValueError("it has other fields")
        for name in ("config", "inputs", "outputs", "timings", "packages", "labels", "sources"):
            if not isinstance(content[name], dict):
                raise ValueError(f"{name} is no object")
        return Stamp(**content | {"seeds": tuple(content["seeds"])})
    except (ValueError, TypeError) as error:
        raise DataError(path, f"must be the stamp of a result: {error}") from error


def require_coherent(paths: Sequence[Path]) -> dict[Path, Stamp]:
    """The stamps of results and of all that they were made from, if they belong together.

    Raises
    ------
    MixtureError
        where a result is not the one that was stamped, was made from other inputs than the ones
        that are there, or where two were made under different configuration, code or packages
    DataError
        where a stamp is missing or unreadable
    """
    stamps: dict[Path, Stamp] = {}
    for path in map(Path, paths):
        _collect(path, stamps)
        _require_outputs(path, stamps[path])
    first: dict[tuple[str, str], Path] = {}
    for path, stamp in stamps.items():
        for name, value in _shared(stamp).items():
            other = first.setdefault(name, path)
            if _shared(stamps[other])[name] != value:
                raise _mixture(path, other, name[1], value, _shared(stamps[other])[name])
    return stamps


def _collect(path: Path, stamps: dict[Path, Stamp]) -> None:
    """Read a stamp and those of its inputs; an input that is no longer there cannot disagree."""
    if path in stamps:
        return
    stamp = stamps[path] = read_stamp(path)
    for name, identity in stamp.inputs.items():
        source = Path(os.path.normpath(path.parent / name))
        if not source.is_file():
            continue
        _collect(source, stamps)
        if stamps[source].identity != identity:
            raise MixtureError(
                path,
                f"was made from another result than {source}; delete what lies beside it and make it again",
            )


def _require_outputs(path: Path, stamp: Stamp) -> None:
    for name, digest in {**stamp.outputs, **stamp.timings}.items():
        file = path.parent / name
        if file.exists() and digest_file(file) != digest:
            raise MixtureError(
                file, f"is not the result that {path} was written for; delete it and make it again"
            )


def _shared(stamp: Stamp) -> dict[tuple[str, str], Any]:
    """What must agree with other stamps: sections of the configuration; code and packages by stage."""
    config = {("configuration", key): value for key, value in stamp.config.items()}
    made = {"version": stamp.version, "code": stamp.code, "packages": dict(stamp.packages)}
    return config | {(stamp.stage, key): value for key, value in made.items()}


def _mixture(path: Path, other: Path, key: str, value: Any, expected: Any) -> MixtureError:
    """Which key differs, as deep as it goes, and what to do."""
    while isinstance(value, dict) and isinstance(expected, dict):
        name = next(k for k in sorted({*value, *expected}) if value.get(k) != expected.get(k))
        key, value, expected = f"{key}.{name}", value.get(name), expected.get(name)
    return MixtureError(
        path,
        f"must be that of {other}, which has {expected!r}; results of two runs are mixed, delete one and make"
        " it again",
        field=key,
        value=value,
    )
