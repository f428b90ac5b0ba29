"""A host on this machine that gives files as well, or as badly, as real ones do."""

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from email.message import Message
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import urlsplit


@dataclass
class Host:
    """What the host does; tests change it."""

    files: dict[str, bytes] = field(default_factory=dict)  # content by path
    ranges: bool = True  # whether parts are given
    # (status, headers) given to the next requests instead of a file, one each.
    answers: list[tuple[int, dict[str, str]]] = field(default_factory=list)
    # Bytes of body after which the connection of the next requests breaks, one each.
    cut: list[int | None] = field(default_factory=list)
    kind: str = "application/zip"  # Content-Type
    requests: list[tuple[str, str]] = field(default_factory=list)  # (path, Range) of every request so far
    root: str = ""

    def url(self, path: str) -> str:
        return f"{self.root}{path}"

    @property
    def bytes_asked(self) -> int:
        """Bytes of all the ranges asked for."""
        spans = [re.fullmatch(r"bytes=(\d+)-(\d+)", span) for _, span in self.requests]
        return sum(int(span[2]) - int(span[1]) + 1 for span in spans if span)


class _Handler(BaseHTTPRequestHandler):
    host: Host

    def do_GET(self) -> None:
        host = self.host
        wanted = self.headers.get("Range", "")
        host.requests.append((self.path, wanted))
        if host.answers:
            status, headers = host.answers.pop(0)
            self._head(status, 0, headers)
            return
        data = host.files.get(urlsplit(self.path).path)
        if data is None:
            self._head(404, 0, {})
            return
        status, headers = 200, {"Content-Type": host.kind, "ETag": f'"{hash(data)}"'}
        match = re.fullmatch(r"bytes=(\d+)-(\d*)", wanted)
        if host.ranges and match:
            start, stop = int(match[1]), min(int(match[2] or len(data)) + 1, len(data))
            status = 206
            headers["Content-Range"] = f"bytes {start}-{stop - 1}/{len(data)}"
            data = data[start:stop]
        cut = host.cut.pop(0) if host.cut else None
        self._head(status, len(data), headers)
        self.wfile.write(data if cut is None else data[:cut])
        if cut is not None:
            self.close_connection = True

    def _head(self, status: int, length: int, headers: dict[str, str]) -> None:
        self.send_response(status)
        for name, value in {**headers, "Content-Length": str(length)}.items():
            self.send_header(name, value)
        self.end_headers()

    def log_message(self, format: str, *args: object) -> None:
        """Nothing: tests look at ``requests``."""


@contextmanager
def serve() -> Iterator[Host]:
    """A host that answers while the block runs."""
    host = Host()
    handler = type("Handler", (_Handler,), {"host": host, "MessageClass": Message})
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    server.daemon_threads = True
    host.root = f"http://127.0.0.1:{server.server_port}"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield host
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
