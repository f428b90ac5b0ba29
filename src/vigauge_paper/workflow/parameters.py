"""Parameters of rules that a job's files and wildcards give; Snakemake goes by the names of arguments."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from vigauge_paper.ids import CONFIGURATIONS


def named(key: str, names: Iterable[str]) -> Callable[[Any, Any], list[str]]:
    """NAME=FILE of every file of the input ``key``."""

    def pairs(wildcards: Any, input: Any) -> list[str]:
        return [f"{name}={file}" for name, file in zip(names, getattr(input, key), strict=True)]

    return pairs


def flags_of(read: Mapping[str, Iterable[str]]) -> Callable[[Any, Any], str]:
    """Flags NAME=FILE of those kinds of result that a job has among its inputs."""

    def flags(wildcards: Any, input: Any) -> str:
        there = [kind for kind in read if hasattr(input, kind)]
        return shlex.join(
            word for kind in there for word in (f"--{kind}", *named(kind, read[kind])(wildcards, input))
        )

    return flags


def of_sequence(about: Callable[[str], Any]) -> Callable[[Any], Any]:
    """What a method of the sequences says of the one that a job is for; an input as well."""
    return lambda wildcards: about(wildcards.sequence)


def scene_of(wildcards: Any) -> str:
    """Flags of the trajectory and points that a simulated configuration is made of."""
    trajectory, points = CONFIGURATIONS[wildcards.configuration]
    return f"--trajectory {trajectory} --points {points}"


def changed_by(wildcards: Any) -> str:
    """Flags of a setting of the sweep, KEY=VALUE."""
    key, _, value = wildcards.setting.partition("=")
    return f"--parameter {key} --value {value}"


def folder_of_published(wildcards: Any, input: Any) -> str:
    """The flag of the folder of the paper's numbers, none where they are not shown."""
    return f"--published {shlex.quote(str(Path(input.published[0]).parent))}" if input.published else ""


def folder_of_output(wildcards: Any, output: Any) -> str:
    """Folder of the first file that a job makes."""
    return str(Path(output[0]).parent)


def from_the_output(files: Mapping[str, str]) -> Callable[[Any, Any], list[str]]:
    """NAME=FILE of files that a job names but does not read, in the place where it makes its own.

    A module's prefix stands before that place.
    """

    def pairs(wildcards: Any, output: Any) -> list[str]:
        return [
            f"{name}={Path(folder_above_output(wildcards, output), file)}" for name, file in files.items()
        ]

    return pairs


def folder_of(key: str) -> Callable[[Any, Any], str]:
    """Folder of the first file of the input ``key``."""
    return lambda wildcards, input: str(Path(getattr(input, key)[0]).parent)


def folder_above(key: str) -> Callable[[Any, Any], str]:
    """Folder of the folder that the first file of the input ``key`` is in."""
    return lambda wildcards, input: str(Path(getattr(input, key)[0]).parents[1])


def folder_above_output(wildcards: Any, output: Any) -> str:
    """Folder in which a job makes the folder of its first file."""
    return str(Path(output[0]).parents[1])
