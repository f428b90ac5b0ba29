"""A reader of outside files under test: its valid files, and how they are spoilt.

The property: a reader takes the file or raises VigaugeError; nothing else, and soon.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random

from vigauge.errors import VigaugeError

from . import mutations

Spoil = Callable[[Random, bytes], bytes]


@dataclass(frozen=True)
class Reader:
    """One reader: ``read`` takes the bytes of a file; ``spoil`` makes one of the ``seeds`` bad."""

    name: str
    seeds: list[bytes]
    read: Callable[[bytes], None]
    spoil: Spoil

    def input(self, seed: int) -> bytes:
        """Input number ``seed``: mostly a spoilt file, sometimes a valid one or random bytes."""
        rng = Random(f"{self.name} {seed}")
        if rng.random() < 0.03:
            return rng.randbytes(rng.choice((0, 1, 10, 1000)))
        data = rng.choice(self.seeds)
        return data if rng.random() < 0.02 else self.spoil(rng, data)


def outcome(reader: Reader, data: bytes) -> str:
    """'accepted' or the name of the error; whatever else is raised is a crash and goes on."""
    try:
        reader.read(data)
    except VigaugeError as error:
        str(error)  # a message must be possible, and short
        assert len(str(error)) < 5000, f"message of {len(str(error))} characters"
        return type(error).__name__
    return "accepted"


def text_spoil(seeds: list[bytes], tokens: list[bytes], *, separator: bytes = b"") -> Spoil:
    """Bytes spoilt anywhere, and fields of a table, where there is a ``separator`` of them."""

    def spoil(rng: Random, data: bytes) -> bytes:
        if separator and rng.random() < 0.5:
            return mutations.spoil_fields(rng, data, tokens, separator)
        return mutations.spoil_bytes(rng, data, tokens, seeds)

    return spoil


def binary_spoil(seeds: list[bytes], inside: Spoil, is_kind: Callable[[bytes], bool] = bool) -> Spoil:
    """Bytes spoilt anywhere, or inside the container that a file of a kind is."""

    def spoil(rng: Random, data: bytes) -> bytes:
        if is_kind(data) and rng.random() < 0.6:
            return inside(rng, data)
        return mutations.spoil_bytes(rng, data, [], seeds)

    return spoil


def through(path: Path, read_path: Callable[[Path], object]) -> Callable[[bytes], None]:
    """A reader of bytes that writes them to ``path`` first."""
    path.parent.mkdir(parents=True, exist_ok=True)

    def read(data: bytes) -> None:
        path.write_bytes(data)
        read_path(path)

    return read
