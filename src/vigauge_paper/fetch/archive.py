"""Zip archives from outside: a zip inside a bundle, and a sequence unpacked safely."""

import errno
import hashlib
import shutil
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from vigauge.errors import FetchError
from vigauge.files import atomic_path

# The largest sequence of EuRoC unpacks to less than 3 GB.
LARGEST_SEQUENCE_BYTES = 16_000_000_000

_LOCAL_HEADER_BYTES = 30
_LISTED = 30
# RuntimeError: an encrypted member, or a compression that zipfile does not know. OSError: a place outside.
_BROKEN = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, ValueError, struct.error, OSError)


@contextmanager
def open_zip(stream: IO[bytes] | Path, source: str) -> Iterator[zipfile.ZipFile]:
    """A zip to read; FetchError about ``source`` where it is not whole or cannot be unpacked."""
    with _whole(source), zipfile.ZipFile(stream) as archive:
        yield archive


@contextmanager
def _whole(source: str) -> Iterator[None]:
    try:
        yield
    except _BROKEN as error:
        if isinstance(error, OSError) and error.errno == errno.ENOSPC:
            raise
        raise FetchError(source, f"must be a whole zip archive: {error}") from error


def find_member(archive: zipfile.ZipFile, name: str, size: int | None, source: str) -> zipfile.ZipInfo:
    """The entry of a bundle; FetchError, which lists the bundle, where it is missing or has another size."""
    if name not in archive.namelist():
        # Zips first: the one that was renamed is among them.
        names = sorted(archive.namelist(), key=lambda name: (not name.endswith(".zip"), name))
        raise FetchError(source, f"bundle must contain {name}; found: {_listing(names)}")
    info = archive.getinfo(name)
    if size is not None and info.file_size != size:
        rule = f"{name} must have the size of the table, {size}"
        raise FetchError(source, rule, field="bytes", value=info.file_size)
    return info


def _listing(names: list[str]) -> str:
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return (", ".join(names[:_LISTED]) or "nothing") + more


def data_span(stream: IO[bytes], info: zipfile.ZipInfo, source: str) -> tuple[int, int]:
    """Where the (compressed) data of a member start and stop in its bundle ``stream``."""
    with _whole(source):
        stream.seek(info.header_offset + _LOCAL_HEADER_BYTES - 4)
        start = info.header_offset + _LOCAL_HEADER_BYTES + sum(struct.unpack("<2H", stream.read(4)))
    return start, start + info.compress_size


def unpack_member(packed: Path, info: zipfile.ZipInfo, target: Path, source: str) -> None:
    """Make ``target`` of the data that :func:`data_span` bounds, in ``packed``, which is deleted."""
    if info.compress_type == zipfile.ZIP_STORED:
        packed.replace(target)
        return
    with (
        _whole(source),
        packed.open("rb") as stream,
        zipfile.ZipExtFile(stream, "r", info) as member,
        atomic_path(target) as temporary,
        temporary.open("wb") as out,
    ):
        shutil.copyfileobj(member, out)
    packed.unlink()


def require_digest(path: Path, size: int | None, sha256: str | None, source: str) -> str:
    """SHA-256 of a file; FetchError where it or the size is not the expected one."""
    if size is not None and path.stat().st_size != size:
        rule = f"must have the size of the table, {size}"
        raise FetchError(source, rule, field="bytes", value=path.stat().st_size)
    with path.open("rb") as stream:
        found = hashlib.file_digest(stream, "sha256").hexdigest()
    if sha256 is not None and found != sha256:
        rule = f"must have the checksum of the table, {sha256}"
        raise FetchError(source, rule, field="sha256", value=found)
    return found


def extract_sequence(
    path: Path, sequence: str, folder: Path, source: str, largest: int = LARGEST_SEQUENCE_BYTES
) -> int:
    """Unpack ``mav0`` of a sequence's zip into ``folder``; returns the number of files.

    ``mav0`` lies at the top of the zip or in a folder of the sequence's name. Names and sizes
    are checked before the first file is written.

    Raises FetchError for names that lead out of the folder, links and other special files, more than
    ``largest`` bytes, no ``mav0``, and members that are damaged or cannot be unpacked.
    """
    with open_zip(path, source) as archive:
        members = archive.infolist()
        _require_harmless(members, source, largest)
        names = [info.filename for info in members]
        tops = [top for top in ("", f"{sequence}/") if any(n.startswith(f"{top}mav0/") for n in names)]
        if not tops:
            found = _listing(sorted({name.split("/")[0] for name in names}))
            raise FetchError(source, f"zip of a sequence must have mav0 at its top; found: {found}")
        files = [info for info in members if info.filename.startswith(f"{tops[0]}mav0/")]
        files = [info for info in files if not info.is_dir()]
        for info in files:
            info.filename = info.filename.removeprefix(tops[0])
            archive.extract(info, folder)
        return len(files)


def _require_harmless(members: list[zipfile.ZipInfo], source: str, largest: int) -> None:
    # zipfile stops a member that unpacks to more than it declares.
    total = sum(info.file_size for info in members)
    if total > largest:
        raise FetchError(source, f"must unpack to at most {largest} bytes", value=total)
    for info in members:
        name, rule = info.orig_filename, ""
        if name.startswith("/") or ".." in name.split("/") or {"\\", ":"} & set(name):
            rule = "member's name must lead to a place inside the folder"
        elif stat.S_IFMT(info.external_attr >> 16) not in (0, stat.S_IFREG, stat.S_IFDIR):
            rule = "members must be files and folders, no links or devices"
        if rule:
            raise FetchError(source, rule, field="member", value=name)
