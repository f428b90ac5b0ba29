"""Bringing a sequence from the first of its sources that gives it, whole, checked, and all or nothing."""

from __future__ import annotations

import logging
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO

import requests

from vigauge.errors import DataError, FetchError
from vigauge.files import write_json
from vigauge.recordings.asl.sequence import read_sequence

from .archive import (
    Member,
    buffered,
    declared_bytes,
    extract_sequence,
    find_member,
    holds,
    require_digest,
    unpack_member,
)
from .http import (
    Patience,
    Progress,
    Remote,
    RemoteFile,
    discard,
    download,
    open_session,
    probe,
    require_space,
)
from .sources import Source, bundle_of, sources_of

LOG = logging.getLogger(__name__)

RECORD = "fetched.json"
_DOWNLOADS = ".downloads"
# Downloads of one file that turn out to be another one.
_WRONG_FILES = 2
# A sequence of EuRoC unpacks to less than twice the size of its zip.
_UNPACKED = 2.0


@contextmanager
def no_progress(label: str, have: int, total: int) -> Iterator[Callable[[int], object]]:
    """Says nothing."""
    yield lambda count: None


@dataclass(frozen=True)
class Fetched:
    """Where a sequence came from; written beside ``mav0`` as ``fetched.json``."""

    sequence: str
    host: str
    url: str
    member: str | None
    bytes: int
    sha256: str
    sha256_expected: bool
    files: int


def fetch_sequence(
    sequence: str,
    sources: list[Source],
    table: Path,
    root: Path,
    patience: Patience = Patience(),  # noqa: B008 - frozen
    progress: Progress = no_progress,
) -> Fetched:
    """Make ``root/sequence/mav0`` from the sources of a table; it appears when it is whole.

    Sources are tried in order. Downloads go to ``root/.downloads``; what a broken run left
    there is gone on with.

    Raises
    ------
    FetchError
        where no source gives the sequence, with the reason of each; where the disk is too small.
    DataError
        where the folder exists already (it is never replaced) or the table has no such row.
    """
    rows = sources_of(sources, sequence, table)
    target = root / sequence
    if target.exists() and any(target.iterdir()):
        raise DataError(target, "folder must be empty or absent: data are never replaced")
    work = root / _DOWNLOADS
    work.mkdir(parents=True, exist_ok=True)
    reasons = []
    with open_session(patience) as session:
        job = _Job(session, work, patience, progress)
        for source in rows:
            LOG.info("%s: from %s, %s", sequence, source.host, source)
            try:
                path, digest = job.obtain(source, bundle_of(sources, source))
                return _unpack(path, digest, source, target, work)
            except FetchError as error:
                LOG.warning("%s", error)
                reasons.append(f"[{source.host}] {error}")
    notes = "; ".join(dict.fromkeys(source.note for source in rows if source.note))
    raise FetchError(
        sequence,
        f"no source gave the sequence. Get it by hand ({notes}), unpack it in ASL layout and name the folder"
        f" that holds {sequence}/mav0 by EUROC_ROOT or euroc.root; or add a mirror to {table}."
        f" Reasons: {'; '.join(reasons)}",
    )


def _unpack(path: Path, digest: str, source: Source, target: Path, work: Path) -> Fetched:
    """The sequence's zip, unpacked beside, read as a check, and moved to its place.

    The zip goes when it is unpacked or found bad; when the run is stopped it stays for the next.
    """
    require_space(work, declared_bytes(path, str(source)), f"to unpack {source.name}")
    staging = work / source.name
    shutil.rmtree(staging, ignore_errors=True)
    try:
        files = extract_sequence(path, source.name, staging, str(source))
        try:
            read_sequence(staging)
        except DataError as error:
            raise FetchError(str(source), f"must hold a readable sequence: {error}") from error
        fetched = Fetched(
            sequence=source.name,
            host=source.host,
            url=source.url,
            member=source.member,
            bytes=path.stat().st_size,
            sha256=digest,
            sha256_expected=source.sha256 is not None,
            files=files,
        )
        write_json(staging / RECORD, asdict(fetched))
        staging.replace(target)
    except BaseException as error:
        shutil.rmtree(staging, ignore_errors=True)
        if isinstance(error, FetchError):
            discard(path)
        raise
    discard(path)
    return fetched


@dataclass(frozen=True)
class _Job:
    """What downloads of a sequence share."""

    session: requests.Session
    work: Path
    patience: Patience
    progress: Progress

    def obtain(self, source: Source, bundle: Source | None) -> tuple[Path, str]:
        """The sequence's zip and its SHA-256; a file that is not what it should be is fetched once more."""
        for attempt in range(1, _WRONG_FILES + 1):
            remote = probe(self.session, source.url, self.patience)
            try:
                if source.member is None:
                    return self._whole(remote, source, source.name)
                if remote.ranges:
                    return self._part(remote, source, source.member)
                return self._from_bundle(remote, source, source.member, bundle)
            except _WrongFileError as error:
                if attempt == _WRONG_FILES:
                    raise
                seconds = self.patience.wait_s(attempt)
                LOG.warning("%s; deleted; trying again in %.0f s", error, seconds)
                time.sleep(seconds)
        raise AssertionError("unreachable: the last attempt returns or raises")

    def _whole(self, remote: Remote, row: Source, name: str, unpacked: int | None = None) -> tuple[Path, str]:
        """The file at an address, checked against its row."""
        if None not in (remote.size, row.size) and remote.size != row.size:
            rule = f"must have the size of the table, {row.size}"
            raise FetchError(row.url, rule, field="bytes", value=remote.size)
        size = remote.size or row.size
        if size is None:
            raise FetchError(row.url, "size must be known, from the host or from the table", field="bytes")
        path = self.work / f"{name}.zip"
        self._download(remote, (0, size), path, int(_UNPACKED * size) if unpacked is None else unpacked)
        return path, self._checked(path, row, row.url)

    def _part(self, remote: Remote, source: Source, name: str) -> tuple[Path, str]:
        """One member of a bundle, by its range."""
        with buffered(RemoteFile(self.session, remote, self.patience)) as stream:
            member = self._member(stream, source, name)
        packed, path = self.work / f"{source.name}.member", self.work / f"{source.name}.zip"
        if not holds(path, member):  # left by a run that was stopped while unpacking
            span = (member.start, member.stop)
            self._download(remote, span, packed, self._room(member))
            with _wrong_file(packed):
                unpack_member(packed, member, path, str(source))
            discard(packed)
        return path, self._checked(path, source, str(source))

    def _from_bundle(
        self, remote: Remote, source: Source, name: str, bundle: Source | None
    ) -> tuple[Path, str]:
        """The member by way of the whole bundle, which stays for other sequences of the room."""
        size = "unknown" if remote.size is None else f"{remote.size / 1e9:.2f} GB"
        LOG.warning("%s gives no ranges: the whole bundle is fetched, size %s", source.host, size)
        unknown = Source(f"bundle_of_{source.name}", source.host, source.url, None, None, None, "")
        row = bundle or unknown
        held, _ = self._whole(remote, row, row.name, unpacked=int(3 * (source.size or 0)))
        packed, path = self.work / f"{source.name}.member", self.work / f"{source.name}.zip"
        with held.open("rb") as stream:
            member = self._member(stream, source, name)
            require_space(self.work, member.stop - member.start + self._room(member), f"for {source.name}")
            stream.seek(member.start)
            with packed.open("wb") as out:
                _copy(stream, out, member.stop - member.start)
        with _wrong_file(held):
            unpack_member(packed, member, path, str(source))
        LOG.info("%s stays for other sequences; it may be deleted", held)
        return path, self._checked(path, source, str(source))

    @staticmethod
    def _member(stream: IO[bytes], source: Source, name: str) -> Member:
        member = find_member(stream, name, source.url)
        if source.size is not None and member.size != source.size:
            rule = f"{name} must have the size of the table, {source.size}"
            raise FetchError(source.url, rule, field="bytes", value=member.size)
        return member

    @staticmethod
    def _room(member: Member) -> int:
        """Bytes needed besides the packed member: unpacked images, and the zip where it is deflated."""
        return int(_UNPACKED * member.size) + (member.size if member.deflated else 0)

    def _download(self, remote: Remote, span: tuple[int, int], path: Path, unpacked: int) -> None:
        there = path.stat().st_size if path.exists() else 0
        missing = max(0, span[1] - span[0] - there)
        require_space(self.work, missing + unpacked, f"to fetch and unpack {path.stem}")
        download(self.session, remote, span, path, self.patience, self.progress)

    def _checked(self, path: Path, row: Source, source: str) -> str:
        with _wrong_file(path):
            return require_digest(path, row.size, row.sha256, source)


class _WrongFileError(FetchError):
    """The bytes came, but they are not those of the file: another download may help."""


@contextmanager
def _wrong_file(path: Path) -> Iterator[None]:
    """Marks a FetchError as one about content, and deletes the file that is wrong."""
    try:
        yield
    except FetchError as error:
        discard(path)
        raise _WrongFileError(
            error.file, error.rule, row=error.row, field=error.field, value=error.value
        ) from error


def _copy(stream: IO[bytes], out: IO[bytes], count: int) -> None:
    while count > 0 and (chunk := stream.read(min(count, 1 << 20))):
        out.write(chunk)
        count -= len(chunk)
