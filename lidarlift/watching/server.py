"""A page of a run's progress in a browser: read-only, on this machine unless another address is stated."""

from __future__ import annotations

import ipaddress
import json
import socket
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from threading import Thread
from types import TracebackType
from typing import Any, Self
from urllib.parse import parse_qs, urlsplit

from slam.data.errors import InputError

LOOPBACK = "127.0.0.1"
TIMEOUT = 10.0  # s for a request, so that open connections end
MAX_PORT = 65535
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}
#: The files of the page by their paths, and their types. There are no others: nothing is looked up by a request's path.
PAGE = {
    "/": ("index.html", "text/html; charset=utf-8"),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
    "/page.js": ("page.js", "text/javascript; charset=utf-8"),
}


def address_of(text: str) -> tuple[str, int]:
    """Return host and port of --serve PORT or HOST:PORT.

    Raises:
        InputError: It is neither.
    """
    host, _, port = text.rpartition(":")
    if not port.isdecimal() or int(port) > MAX_PORT:
        raise InputError(f"--serve {text}: give a port from 0 to {MAX_PORT}, as in 8080, or an address, 0.0.0.0:8080")
    return host.strip("[]") or LOOPBACK, int(port)


class ProgressServer:
    """Serves the page from a thread until the end of a `with` statement.

    Requests whose Host header names another machine are refused: a foreign page could otherwise read the progress by a
    name that resolves to this address (DNS rebinding).

    Args:
        state: Returns the progress since a version, a number of frames and a number of parts; see `Progress.state`.
        host: Address to listen on.
        port: Port to listen on; 0 for any free one.

    Attributes:
        url: Address of the page.

    Raises:
        InputError: The address cannot be used.
    """

    def __init__(self, state: Callable[[int, int, int], dict[str, Any]], host: str = LOOPBACK, port: int = 0) -> None:
        page = {path: (_read(name), kind) for path, (name, kind) in PAGE.items()}

        class Handler(_Handler):
            content, progress, bound = page, staticmethod(state), host

        try:
            self._server = _Server((host, port), Handler)
        except (OSError, OverflowError) as error:
            fault = error.strerror or error if isinstance(error, OSError) else error
            raise InputError(f"--serve: cannot listen on {host} port {port} ({fault}); choose another port") from error
        self.port = self._server.server_address[1]
        name = f"[{host}]" if ":" in host else host
        self.url = f"http://{name}:{self.port}/"
        self._thread = Thread(target=self._server.serve_forever, name="progress server", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._server.shutdown()
        self._server.server_close()


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, address: tuple[str, int], handler: type[BaseHTTPRequestHandler]) -> None:
        self.address_family = socket.AF_INET6 if ":" in address[0] else socket.AF_INET
        super().__init__(address, handler)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print nothing: a browser that closes a connection is no error."""


class _Handler(BaseHTTPRequestHandler):
    content: dict[str, tuple[bytes, str]]
    progress: Callable[[int, int, int], dict[str, Any]]
    bound: str
    timeout = TIMEOUT
    server_version, sys_version = "lidarlift", ""

    def do_GET(self) -> None:
        if not names_this_machine(self.headers.get("Host", ""), self.bound):
            self.send_error(HTTPStatus.MISDIRECTED_REQUEST, "another host name")
            return
        url = urlsplit(self.path)
        if url.path == "/progress.json":
            self._send_progress(url.query)
        elif url.path in self.content:
            self._send(*self.content[url.path])
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    def do_HEAD(self) -> None:
        self.do_GET()

    def _send_progress(self, query: str) -> None:
        try:
            asked = parse_qs(query, max_num_fields=3)
            version, frames, parts = (int(asked.get(name, [start])[0]) for name, start in SINCE.items())
        except ValueError:
            self.send_error(HTTPStatus.BAD_REQUEST)
            return
        state = self.progress(version, max(frames, 0), max(parts, 0))
        self._send(json.dumps(state, separators=(",", ":")).encode(), "application/json")

    def _send(self, content: bytes, kind: str) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        if self.command != "HEAD":
            with suppress(OSError):
                self.wfile.write(content)

    def end_headers(self) -> None:
        """Add the headers that keep other pages out."""
        for name, value in HEADERS.items():
            self.send_header(name, value)
        super().end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Print nothing: stderr has the progress bar."""


SINCE = {"version": "-1", "frames": "0", "parts": "0"}


def names_this_machine(header: str, bound: str) -> bool:
    """Check a Host header: localhost, an address, the name that is listened on, or this machine's own name.

    An address in the header is none that a foreign name could stand for.
    """
    name = header.rpartition(":")[0] if header.rpartition(":")[2].isdecimal() else header
    name = name.strip("[]").lower().rstrip(".")
    with suppress(ValueError):
        return bool(ipaddress.ip_address(name))
    own = {"localhost", bound.lower()}
    if bound != LOOPBACK:
        own |= {socket.gethostname().lower(), f"{socket.gethostname()}.local".lower()}
    return name in own


def _read(name: str) -> bytes:
    return (files("lidarlift.watching") / "page" / name).read_bytes()
