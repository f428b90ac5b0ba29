"""Reading a file over HTTP: all of it or a part, with bounded patience, resumed where it broke off."""

from __future__ import annotations

import io
import json
import logging
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import requests
from requests.adapters import HTTPAdapter
from urllib3.exceptions import InvalidHeader
from urllib3.response import BaseHTTPResponse
from urllib3.util import Retry

from vigauge.errors import FetchError
from vigauge.files import write_text

LOG = logging.getLogger(__name__)

_BUSY = (429, 500, 502, 503, 504)
_CHUNK_BYTES = 1 << 20
# An attempt that brought less than this counts as one that failed.
_PROGRESS_BYTES = 1 << 20

# Given a label, the bytes there are and those there will be: a context whose value takes bytes as they come.
Progress = Callable[[str, int, int], AbstractContextManager[Callable[[int], object]]]


@dataclass(frozen=True)
class Patience:
    """How long to go on: ``attempts`` a request, waits doubling from ``first_wait_s`` to ``longest_wait_s``.

    ``timeout_s`` is that of a connection, and of silence on an open one.
    """

    attempts: int = 6
    first_wait_s: float = 10.0
    longest_wait_s: float = 300.0
    timeout_s: float = 60.0

    def wait_s(self, failures: int) -> float:
        """Seconds to wait after so many failures in a row, 1 or more."""
        return min(self.longest_wait_s, self.first_wait_s * 2.0 ** (failures - 1))


class _Retry(Retry):
    """urllib3's retries, which honour Retry-After, but waiting from the first failure on and saying so."""

    def get_backoff_time(self) -> float:
        failures = len(self.history)
        return float(min(self.backoff_max, self.backoff_factor * 2.0 ** max(failures - 1, 0)))

    def sleep(self, response: BaseHTTPResponse | None = None) -> None:
        seconds = None
        if response is not None:
            try:
                seconds = self.get_retry_after(response)
            except InvalidHeader:
                LOG.debug("Retry-After that is neither seconds nor a date")
        seconds = min(seconds or self.get_backoff_time(), float(self.backoff_max))
        last = self.history[-1]
        reason = f"HTTP {last.status}" if last.status else f"{type(last.error).__name__}"
        LOG.warning("%s; trying again in %.0f s (%s attempts left)", reason, seconds, self.total)
        time.sleep(seconds)


def open_session(patience: Patience) -> requests.Session:
    """A session that repeats requests on 429, 5xx and broken connections."""
    retry = _Retry(
        total=patience.attempts - 1,
        status_forcelist=_BUSY,
        backoff_factor=patience.first_wait_s,
        backoff_max=patience.longest_wait_s,
        retry_after_max=max(1, int(patience.longest_wait_s)),
        raise_on_status=False,
    )
    session = requests.Session()
    session.headers["Accept-Encoding"] = "identity"
    for scheme in ("http://", "https://"):
        session.mount(scheme, HTTPAdapter(max_retries=retry))
    return session


@dataclass(frozen=True)
class Remote:
    """What a host says of a file.

    Attributes
    ----------
    url : its address
    size : bytes, or None where the host does not say
    ranges : whether it gives parts of it
    validator : ETag or date, by which a changed file is told; empty where it gives none
    """

    url: str
    size: int | None
    ranges: bool
    validator: str


@contextmanager
def _get(
    session: requests.Session, url: str, patience: Patience, **headers: str
) -> Iterator[requests.Response]:
    """An open answer of status 200 or 206 that is not a web page; FetchError otherwise."""
    try:
        with session.get(url, headers=headers, stream=True, timeout=patience.timeout_s) as response:
            if response.status_code not in (200, 206):
                after = f" after {patience.attempts} attempts" if response.status_code in _BUSY else ""
                answer = f"{response.status_code} {response.reason or ''}".strip()
                raise FetchError(url, f"host must give the file; it answered HTTP {answer}{after}")
            kind = response.headers.get("Content-Type", "")
            if kind.split(";")[0].strip().lower() in ("text/html", "application/xhtml+xml"):
                raise FetchError(
                    url, "must be a zip archive, not a web page", field="Content-Type", value=kind
                )
            yield response
    except requests.RequestException as error:
        raise FetchError(url, f"host must answer: {_innermost(error)}") from error


def _innermost(error: BaseException) -> str:
    """The cause below the wrappings of HTTP libraries."""
    while error.args and isinstance(error.args[-1], BaseException):
        error = error.args[-1]
    reason = getattr(error, "reason", None)
    return _innermost(reason) if isinstance(reason, BaseException) else str(error)


def probe(session: requests.Session, url: str, patience: Patience) -> Remote:
    """Size of a file, and whether parts can be had, from a request for its first byte."""
    with _get(session, url, patience, Range="bytes=0-0") as response:
        headers = response.headers
        validator = headers.get("ETag", "")
        if not validator or validator.startswith("W/"):  # a weak one does not tell bytes apart
            validator = headers.get("Last-Modified", "")
        if response.status_code == 206:
            total = headers.get("Content-Range", "").rpartition("/")[2]
            if total.isdecimal():
                return Remote(url, int(total), True, validator)
        length = headers.get("Content-Length", "")
        size = int(length) if response.status_code == 200 and length.isdecimal() else None
        return Remote(url, size, False, validator)


class RemoteFile(io.RawIOBase):
    """A file on a host that gives ranges, as a seekable file: a request a read, so put a buffer around it."""

    def __init__(self, session: requests.Session, remote: Remote, patience: Patience) -> None:
        if remote.size is None or not remote.ranges:
            raise ValueError("the host must give ranges")
        self._session, self._remote, self._patience = session, remote, patience
        self._size = remote.size
        self._at = 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._at

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        base = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._size}[whence]
        if base + offset < 0:
            raise OSError("seek before the start of the file")
        self._at = base + offset
        return self._at

    def readinto(self, buffer: Any) -> int:
        wanted = min(len(buffer), self._size - self._at)
        if wanted <= 0:
            return 0
        span = f"bytes={self._at}-{self._at + wanted - 1}"
        with _get(self._session, self._remote.url, self._patience, Range=span) as response:
            _require_span(response, self._remote, self._at)
            data = response.content
        if len(data) != wanted:
            raise FetchError(self._remote.url, f"host must give {span}", value=f"{len(data)} bytes")
        buffer[:wanted] = data
        self._at += wanted
        return wanted


def _require_span(response: requests.Response, remote: Remote, start: int) -> None:
    """The answer must be the part that was asked for, of the file that was probed."""
    found = response.headers.get("Content-Range", "")
    if response.status_code != 206 or not found.startswith(f"bytes {start}-"):
        raise FetchError(
            remote.url, f"host must give bytes from {start} on", field="Content-Range", value=found
        )
    if not found.endswith(f"/{remote.size}"):
        raise FetchError(
            remote.url, "file must not change while it is read", field="Content-Range", value=found
        )


def require_space(folder: Path, needed: int, purpose: str) -> None:
    """FetchError where the disk of ``folder`` has fewer bytes free than ``needed``."""
    free = shutil.disk_usage(folder).free
    if needed > free:
        rule = f"disk must have {needed / 1e9:.2f} GB free {purpose}"
        raise FetchError(folder, rule, value=f"{free / 1e9:.2f} GB")


def download(
    session: requests.Session,
    remote: Remote,
    span: tuple[int, int],
    target: Path,
    patience: Patience,
    progress: Progress,
) -> None:
    """Bytes ``span[0]`` to ``span[1]`` of a remote file into ``target``, in one request if it holds.

    What an earlier run left in ``target`` is kept, where the host gives ranges and the file
    is the same: a note beside ``target`` tells.

    Raises
    ------
    FetchError
        where the bytes could not be had; what there is stays for the next run.
    """
    start, stop = span
    note = _note(target)
    about = json.dumps(asdict(remote) | {"start": start, "stop": stop}, sort_keys=True)
    same = note.is_file() and note.read_text("utf-8") == about and target.is_file()
    if not same or (not remote.ranges and target.stat().st_size != stop - start):
        discard(target)
        write_text(note, about)
    failures = 0
    best = have = target.stat().st_size if target.exists() else 0
    with progress(target.stem, have, stop - start) as tell:
        while have < stop - start:
            if failures:
                seconds = patience.wait_s(failures)
                LOG.warning("%s: broke off at %d bytes; going on in %.0f s", target.stem, have, seconds)
                time.sleep(seconds)
            have = have if remote.ranges else 0
            have = _append(session, remote, start, stop, have, target, patience, tell)
            failures = 0 if have - best >= _PROGRESS_BYTES else failures + 1
            best = max(best, have)
            if failures >= patience.attempts and have < stop - start:
                rule = f"must give {stop - start} bytes; it broke off {failures} times in a row"
                raise FetchError(remote.url, rule, value=f"{have} bytes")


def _note(target: Path) -> Path:
    return target.with_name(target.name + ".json")


def discard(target: Path) -> None:
    """Delete a download and the note beside it."""
    target.unlink(missing_ok=True)
    _note(target).unlink(missing_ok=True)


def _append(
    session: requests.Session,
    remote: Remote,
    start: int,
    stop: int,
    have: int,
    target: Path,
    patience: Patience,
    tell: Callable[[int], object],
) -> int:
    """One request for what is missing; the number of bytes there are after it."""
    headers = {"Range": f"bytes={start + have}-{stop - 1}"} if remote.ranges else {}
    with (
        _get(session, remote.url, patience, **headers) as response,
        target.open("ab" if have else "wb") as stream,
    ):
        if remote.ranges:
            _require_span(response, remote, start + have)
        try:
            for chunk in response.iter_content(_CHUNK_BYTES):
                stream.write(chunk[: stop - start - have])
                have += len(chunk[: stop - start - have])
                tell(len(chunk))
                if have >= stop - start:
                    break
        except requests.RequestException as error:
            LOG.warning("%s: %s", target.stem, _innermost(error))
    return have
