"""Zips from outside: finding one in another, and unpacking a sequence without trusting what it says."""

from __future__ import annotations

import hashlib
import io
import shutil
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import IO

from vigauge.errors import FetchError

# The largest sequence of EuRoC has 7400 images and unpacks to less than 3 GB.
LARGEST_SEQUENCE_BYTES = 16_000_000_000
MOST_MEMBERS = 200_000

_LOCAL_HEADER = struct.Struct("<4s5H3L2H")
_LOCAL_START = b"PK\x03\x04"
_ENCRYPTED = 0x1
_CHUNK_BYTES = 1 << 20
_LISTED = 30
# A name of EuRoC has 60 characters; file systems take 255 bytes a step.
_LONGEST_NAME, _LONGEST_STEP = 500, 250
_BROKEN = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, ValueError, struct.error)


@dataclass(frozen=True)
class Member:
    """A member of a bundle as it lies there: ``start`` to ``stop`` in the bundle, packed or not."""

    name: str
    start: int
    stop: int
    size: int
    crc: int
    deflated: bool


@contextmanager
def open_zip(stream: IO[bytes] | Path, source: str) -> Iterator[zipfile.ZipFile]:
    """A zip to read; whatever turns out to be broken in it is a FetchError about ``source``."""
    try:
        with _placed():
            opened = zipfile.ZipFile(stream)
        with opened as archive:
            yield archive
    except _BROKEN as error:
        raise FetchError(source, f"must be a whole zip archive: {error}") from error


@contextmanager
def _placed() -> Iterator[None]:
    """While a zip is read: an error of the system comes from a place in it that does not exist."""
    try:
        yield
    except OSError as error:
        raise zipfile.BadZipFile(f"it points outside of itself: {error}") from error


def find_member(stream: IO[bytes], name: str, source: str) -> Member:
    """Where the zip ``name`` lies in the bundle ``stream``; FetchError lists what is there instead."""
    with open_zip(stream, source) as archive:
        if name not in archive.namelist():
            raise FetchError(source, f"bundle must contain {name}; {_listing(archive)}")
        info = archive.getinfo(name)
        _require_readable(info, source)
        with _placed():
            stream.seek(info.header_offset)
            header = stream.read(_LOCAL_HEADER.size)
        fields = _LOCAL_HEADER.unpack(header)
        if fields[0] != _LOCAL_START:
            raise zipfile.BadZipFile(f"no member at {info.header_offset}")
        start = info.header_offset + _LOCAL_HEADER.size + fields[-2] + fields[-1]
        return Member(
            name=name,
            start=start,
            stop=start + info.compress_size,
            size=info.file_size,
            crc=info.CRC,
            deflated=info.compress_type == zipfile.ZIP_DEFLATED,
        )


def _listing(archive: zipfile.ZipFile) -> str:
    """What a bundle has, zips first."""
    names = sorted(archive.namelist(), key=lambda name: (not name.endswith(".zip"), name))
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return f"found: {', '.join(names[:_LISTED]) or 'nothing'}{more}"


def unpack_member(packed: Path, member: Member, target: Path, source: str) -> None:
    """The member whose bytes are in ``packed`` into ``target``, checked by its length and CRC.

    ``packed`` is used up.
    """
    if not member.deflated:
        packed.replace(target)
    else:
        with packed.open("rb") as stream, target.open("wb") as out:
            _inflate(stream, out, member, source)
        packed.unlink()
    if not holds(target, member):
        size = target.stat().st_size
        target.unlink()
        rule = f"{member.name} must have {member.size} bytes and CRC {member.crc:08x}"
        raise FetchError(source, rule, value=f"{size} bytes")


def holds(path: Path, member: Member) -> bool:
    """Whether a file is there and has the length and CRC of a member."""
    if not path.is_file() or path.stat().st_size != member.size:
        return False
    crc = 0
    with path.open("rb") as stream:
        while chunk := stream.read(_CHUNK_BYTES):
            crc = zlib.crc32(chunk, crc)
    return crc == member.crc


def _inflate(stream: IO[bytes], out: IO[bytes], member: Member, source: str) -> None:
    """Raw deflate data, no further than the size that the bundle declares."""
    inflater = zlib.decompressobj(-zlib.MAX_WBITS)
    left = member.size
    try:
        while chunk := stream.read(_CHUNK_BYTES):
            while chunk:
                piece = inflater.decompress(chunk, _CHUNK_BYTES)
                left -= len(piece)
                if left < 0:
                    raise zlib.error(f"more than the declared {member.size} bytes")
                out.write(piece)
                chunk = inflater.unconsumed_tail
    except zlib.error as error:
        raise FetchError(source, f"{member.name} must be whole: {error}") from error


def require_digest(path: Path, size: int | None, sha256: str | None, source: str) -> str:
    """SHA-256 of a file; FetchError, and the file is deleted, where it or the size is another."""
    found_size = path.stat().st_size
    if size is not None and found_size != size:
        path.unlink()
        rule = f"must have the size of the table, {size}"
        raise FetchError(source, rule, field="bytes", value=found_size)
    with path.open("rb") as stream:
        found = hashlib.file_digest(stream, "sha256").hexdigest()
    if sha256 is not None and found != sha256:
        path.unlink()
        rule = f"must have the checksum of the table, {sha256}"
        raise FetchError(source, rule, field="sha256", value=found)
    return found


def extract_sequence(
    path: Path, sequence: str, folder: Path, source: str, largest: int = LARGEST_SEQUENCE_BYTES
) -> int:
    """Unpack ``mav0`` of a sequence's zip into ``folder``, which must not exist; the number of files.

    Every member is checked before the first is written. On an error nothing is left.

    Raises
    ------
    FetchError
        for names that lead out of the folder, links and other special files, encryption,
        doubled names, more members or bytes than ``largest``, no ``mav0``, a wrong CRC.
    """
    try:
        with open_zip(path, source) as archive:
            members = _checked_members(archive, source, largest)
            files = _below_mav0(members, sequence, source)
            for inside, info in files:
                target = folder / inside
                target.parent.mkdir(parents=True, exist_ok=True)
                with target.open("xb") as out:
                    for piece in _pieces(archive, info):
                        out.write(piece)
            return len(files)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _pieces(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> Iterator[bytes]:
    """The content of a member, a chunk at a time; BadZipFile where it is not what the zip says."""
    with _placed():
        member = archive.open(info)
    with member:
        while True:
            with _placed():
                piece = member.read(_CHUNK_BYTES)
            if not piece:
                return
            yield piece


def declared_bytes(path: Path, source: str) -> int:
    """Bytes that a zip says it unpacks to."""
    with open_zip(path, source) as archive:
        return sum(info.file_size for info in archive.infolist())


def _require_readable(info: zipfile.ZipInfo, source: str) -> None:
    name = info.orig_filename
    mode = info.external_attr >> 16
    parts = PureWindowsPath(name)  # knows both kinds of slashes, and drives
    rule = ""
    steps = name.removesuffix("/").split("/")
    if "\x00" in name or "\\" in name or parts.anchor or {"", "..", "."} & set(steps):
        rule = "member's name must lead to a place inside the folder"
    elif len(name) > _LONGEST_NAME or max(len(step.encode()) for step in steps) > _LONGEST_STEP:
        rule = "member's name must be one that file systems take"
    elif stat.S_IFMT(mode) not in (0, stat.S_IFREG, stat.S_IFDIR):
        rule = "members must be files and folders, no links or devices"
    elif info.flag_bits & _ENCRYPTED:
        rule = "members must not be encrypted"
    elif info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        rule = "members must be stored or deflated"
    if rule:
        raise FetchError(source, rule, field="member", value=name)


def _checked_members(archive: zipfile.ZipFile, source: str, largest: int) -> list[zipfile.ZipInfo]:
    members = archive.infolist()
    if len(members) > MOST_MEMBERS:
        raise FetchError(source, f"must have at most {MOST_MEMBERS} members", value=len(members))
    total = sum(info.file_size for info in members)
    if total > largest:
        raise FetchError(source, f"must unpack to at most {largest} bytes", value=total)
    seen: set[str] = set()
    for info in members:
        _require_readable(info, source)
        # Some file systems do not tell case apart: one member would overwrite the other.
        place = info.filename.removesuffix("/").lower()
        if place in seen:
            raise FetchError(source, "names of members must differ", field="member", value=info.filename)
        seen.add(place)
    folders = {str(parent) for place in seen for parent in PurePosixPath(place).parents}
    for info in members:
        if not info.is_dir() and info.filename.lower() in folders:
            rule = "member must be a file or a folder, not both"
            raise FetchError(source, rule, field="member", value=info.filename)
    return members


def _below_mav0(
    members: list[zipfile.ZipInfo], sequence: str, source: str
) -> list[tuple[str, zipfile.ZipInfo]]:
    """Files below ``mav0``, at the top or in a folder of the sequence's name: (place from there, member)."""
    for prefix in ("", f"{sequence}/"):
        files = [
            (info.filename.removeprefix(prefix), info)
            for info in members
            if info.filename.startswith(f"{prefix}mav0/") and not info.is_dir()
        ]
        if files:
            return files
    tops = sorted({info.filename.split("/")[0] for info in members})
    found = ", ".join(tops[:_LISTED]) or "nothing"
    raise FetchError(source, f"zip of a sequence must have mav0 at its top; found: {found}")


def buffered(raw: io.RawIOBase) -> io.BufferedReader:
    """A reader that asks for more than a few bytes at a time, for a file on a host."""
    return io.BufferedReader(raw, buffer_size=1 << 17)
