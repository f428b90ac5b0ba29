"""Fetch a sequence from the first source that gives it; it appears only when it is whole and checked."""

import logging
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from vigauge.errors import DataError, FetchError
from vigauge.files import write_json
from vigauge.recordings.asl.sequence import read_sequence

from .archive import data_span, extract_sequence, find_member, open_zip, require_digest, unpack_member
from .download import Patience, Remote, open_session, require_space
from .sources import Source, bundle_of, sources_of

LOG = logging.getLogger(__name__)

RECORD = "fetched.json"
# A sequence of EuRoC unpacks to less than twice the size of its zip.
_UNPACKED = 2


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
) -> Fetched:
    """Make ``root/sequence/mav0`` from the sources of a table, which are tried in order.

    Downloads go to ``root/.downloads``; an interrupted one resumes in the next run. If the
    server supports range requests, only the sequence's zip is downloaded out of a bundle;
    if not, the whole bundle is, and it stays for other sequences.

    Raises FetchError where no source gives the sequence, with the reason of each; where the disk is too
    small. DataError where the folder exists already (it is never replaced) or the table has no such row.
    """
    rows = sources_of(sources, sequence, table)
    target = root / sequence
    if target.exists() and any(target.iterdir()):
        raise DataError(target, "folder must be empty or absent: data are never replaced")
    work = root / ".downloads" / sequence
    work.mkdir(parents=True, exist_ok=True)
    reasons = []
    with open_session(patience) as session:
        for source in rows:
            LOG.info("%s: from %s, %s", sequence, source.host, source)
            try:
                remote = Remote(session, source.url, patience)
                if source.member is None:
                    path = _whole(remote, source, work)
                elif remote.ranges:
                    path = _part(remote, source, source.member, work)
                else:
                    path = _from_bundle(remote, source, source.member, bundle_of(sources, source), work)
                fetched = _unpack(path, source, target, work)
            except FetchError as error:
                LOG.warning("%s", error)
                reasons.append(f"[{source.host}] {error}")
            else:
                shutil.rmtree(work)
                return fetched
    notes = "; ".join(dict.fromkeys(source.note for source in rows if source.note))
    raise FetchError(
        sequence,
        f"no source gave the sequence. Download it by hand ({notes}), unpack it in ASL layout, and set"
        f" EUROC_ROOT or euroc.root to the folder that holds {sequence}/mav0; or add a mirror to {table}."
        f" Reasons: {'; '.join(reasons)}",
    )


@contextmanager
def _deleted_if_bad(*paths: Path) -> Iterator[None]:
    """Deletes files that turn out not to be what they should be, so that the next run fetches them again."""
    try:
        yield
    except FetchError:
        for path in paths:
            path.unlink(missing_ok=True)
        raise


def _whole(remote: Remote, source: Source, folder: Path, room: int | None = None) -> Path:
    """The file at the address itself: a sequence's zip, or a bundle that needs ``room`` bytes to unpack."""
    if None not in (remote.size, source.size) and remote.size != source.size:
        rule = f"must have the size of the table, {source.size}"
        raise FetchError(source.url, rule, field="bytes", value=remote.size)
    size = remote.size or source.size
    if size is None:
        raise FetchError(source.url, "size must be known, from the server or from the table", field="bytes")
    path = folder / f"{source.name}.{remote.key}.zip"
    require_space(path, size, _UNPACKED * size if room is None else room)
    remote.download((0, size), path)
    return path


def _part(remote: Remote, source: Source, member: str, work: Path) -> Path:
    """The zip of a sequence out of a bundle, by a range request."""
    with remote.open() as stream, open_zip(stream, source.url) as archive:
        info = find_member(archive, member, source.size, source.url)
        span = data_span(stream, info, source.url)
    path = work / f"{source.name}.{remote.key}.zip"
    packed = path.with_suffix(".packed")
    if not path.exists():
        require_space(packed, info.compress_size, (_UNPACKED + 1) * info.file_size)
        remote.download(span, packed)
        with _deleted_if_bad(packed, path):
            unpack_member(packed, info, path, str(source))
    return path


def _from_bundle(remote: Remote, source: Source, member: str, row: Source | None, work: Path) -> Path:
    """The zip of a sequence out of a bundle that is downloaded whole."""
    row = row or Source("bundle", source.host, source.url, None, None, None, "")
    LOG.warning("%s does not support range requests: the whole bundle is downloaded", source.host)
    bundle = _whole(remote, row, work.parent, (_UNPACKED + 1) * (source.size or 0))
    path = work / f"{source.name}.zip"
    with _deleted_if_bad(bundle):
        require_digest(bundle, row.size, row.sha256, row.url)
    with open_zip(bundle, source.url) as archive:
        info = find_member(archive, member, source.size, source.url)
        require_space(path, info.file_size, _UNPACKED * info.file_size)
        with archive.open(info) as stream, path.open("wb") as out:
            shutil.copyfileobj(stream, out)
    LOG.info("%s stays for other sequences; it may be deleted", bundle)
    return path


def _unpack(path: Path, source: Source, target: Path, work: Path) -> Fetched:
    """Check the zip, unpack it in a temporary folder, read it, and move it to its place."""
    with tempfile.TemporaryDirectory(dir=work) as scratch, _deleted_if_bad(path):
        digest = require_digest(path, source.size, source.sha256, str(source))
        staging = Path(scratch) / source.name
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
    return fetched
