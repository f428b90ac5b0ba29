"""Download a file over HTTP, whole or a byte range of it, with retries; an interrupted download resumes."""

from __future__ import annotations

import hashlib
import io
import logging
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import requests
from requests.adapters import HTTPAdapter
from tqdm import tqdm
from urllib3.exceptions import HTTPError, InvalidHeader
from urllib3.response import BaseHTTPResponse
from urllib3.util import Retry

from vigauge.errors import FetchError

LOG = logging.getLogger(__name__)

_BUSY = (429, 500, 502, 503, 504)
_CHUNK_BYTES = 1 << 20
# A broken request that brought less than this counts as a failed attempt.
_PROGRESS_BYTES = 1 << 20


@dataclass(frozen=True)
class Patience:
    """Retries: ``attempts`` in a row; the wait doubles from ``first_wait_s`` to at most ``longest_wait_s``.

    ``timeout_s`` limits how long a connection may stay silent.
    """

    attempts: int = 6
    first_wait_s: float = 10.0
    longest_wait_s: float = 300.0
    timeout_s: float = 60.0


class _Retry(Retry):
    """urllib3's retries, which honour Retry-After; each wait is logged, a malformed header is ignored."""

    def sleep(self, response: BaseHTTPResponse | None = None) -> None:
        last = self.history[-1]
        reason = f"HTTP {last.status}" if last.status else type(last.error).__name__
        LOG.warning("%s; trying again after a wait", reason)
        try:
            super().sleep(response)
        except InvalidHeader:
            super().sleep()


def open_session(patience: Patience) -> requests.Session:
    """A session that repeats requests after HTTP 429, 5xx and failed connections."""
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


class Remote:
    """A file on a server.

    Attributes
    ----------
    url : its address
    size : bytes, or None where the server does not say
    ranges : whether the server supports range requests
    key : short text that changes when the address, the size, the ETag or the date of the file changes
    """

    def __init__(self, session: requests.Session, url: str, patience: Patience) -> None:
        """Ask for the first byte; FetchError where the server does not send it."""
        self.url, self._session, self._patience = url, session, patience
        with self._get((0, 1)) as response:
            headers = response.headers
            partial = response.status_code == 206
            total = headers.get("Content-Range" if partial else "Content-Length", "").rpartition("/")[2]
            self.size = int(total) if total.isdecimal() else None
            self.ranges = partial and self.size is not None
            version = headers.get("ETag") or headers.get("Last-Modified")
        self.key = hashlib.sha256(f"{url} {self.size} {version}".encode()).hexdigest()[:12]

    @contextmanager
    def _get(self, span: tuple[int, int] | None) -> Iterator[requests.Response]:
        """An open response of status 200 or 206 that is not a web page."""
        headers = {"Range": f"bytes={span[0]}-{span[1] - 1}"} if span else {}
        try:
            timeout = self._patience.timeout_s
            with self._session.get(self.url, headers=headers, stream=True, timeout=timeout) as response:
                if response.status_code not in (200, 206):
                    answer = f"{response.status_code} {response.reason or ''}".strip()
                    if response.status_code in _BUSY:
                        answer += f" after {self._patience.attempts} attempts"
                    raise FetchError(self.url, f"server must send the file; it answered HTTP {answer}")
                kind = response.headers.get("Content-Type", "")
                if kind.startswith("text/html"):
                    rule = "must be a zip archive, not a web page"
                    raise FetchError(self.url, rule, field="Content-Type", value=kind)
                yield response
        except (requests.RequestException, HTTPError) as error:
            raise FetchError(self.url, f"server must answer: {error}") from error

    @contextmanager
    def _get_range(self, start: int, stop: int) -> Iterator[requests.Response]:
        with self._get((start, stop)) as response:
            found, expected = response.headers.get("Content-Range"), f"bytes {start}-{stop - 1}/{self.size}"
            if response.status_code != 206 or found != expected:
                rule = f"server must send {expected}"
                raise FetchError(self.url, rule, field="Content-Range", value=found)
            yield response

    def read(self, start: int, stop: int) -> bytes:
        """Bytes ``start`` to ``stop``, for a server that supports ranges."""
        with self._get_range(start, stop) as response:
            return response.content

    def open(self) -> io.BufferedReader:
        """The file as a seekable stream, for a server that supports ranges: one request per 128 kB."""
        return io.BufferedReader(_RangeReader(self), buffer_size=1 << 17)

    def download(self, span: tuple[int, int], target: Path) -> None:
        """Write bytes ``span[0]`` to ``span[1]`` to ``target``.

        If the server supports ranges, what an earlier run left in ``target`` is kept and the
        rest is appended. Raises FetchError where the download fails; ``target`` stays for the next run.
        """
        start, stop = span
        have, failures = _size(target), 0
        scale = {"unit": "B", "unit_scale": True, "disable": None}  # None: no bar without a terminal
        with tqdm(desc=target.stem, initial=have, total=stop - start, **scale) as bar:
            while have < stop - start:
                if failures == self._patience.attempts:
                    rule = f"must give {stop - start} bytes; the download broke off {failures} times in a row"
                    raise FetchError(self.url, rule, value=f"{have} bytes")
                if failures:
                    wait = self._patience.first_wait_s * 2.0 ** (failures - 1)
                    wait = min(self._patience.longest_wait_s, wait)
                    LOG.warning("%s: broke off at %d bytes; resuming in %.0f s", target.stem, have, wait)
                    time.sleep(wait)
                before = have if self.ranges else 0
                have = self._append(start + before, stop, target, bar)
                failures = 0 if self.ranges and have - before >= _PROGRESS_BYTES else failures + 1

    def _append(self, start: int, stop: int, target: Path, bar: tqdm[Any]) -> int:
        """Append what one request brings, or start over without ranges; the size of ``target`` after it."""
        request = self._get_range(start, stop) if self.ranges else self._get(None)
        with request as response, target.open("ab" if self.ranges else "wb") as out:
            try:
                for chunk in response.iter_content(_CHUNK_BYTES):
                    out.write(chunk)
                    bar.update(len(chunk))
            except requests.RequestException as error:
                LOG.warning("%s: %s", target.stem, error)
        return _size(target)


class _RangeReader(io.RawIOBase):
    """A remote file, read at random by range requests."""

    def __init__(self, remote: Remote) -> None:
        self._remote, self._at = remote, 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._remote.size or 0}[whence]
        if at < 0:
            raise OSError("seek before the start of the file")
        self._at = at
        return at

    def readinto(self, buffer: Any) -> int:
        stop = min(self._at + len(buffer), self._remote.size or 0)
        data = self._remote.read(self._at, stop) if stop > self._at else b""
        buffer[: len(data)] = data
        self._at += len(data)
        return len(data)


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def require_space(target: Path, size: int, unpacked: int) -> None:
    """FetchError where the disk cannot hold the rest of a download of ``size`` bytes, and then unpack it."""
    needed, free = size - _size(target) + unpacked, shutil.disk_usage(target.parent).free
    if needed > free:
        rule = f"disk must have {needed / 1e9:.2f} GB free to fetch and unpack {target.stem}"
        raise FetchError(target.parent, rule, value=f"{free / 1e9:.2f} GB")
