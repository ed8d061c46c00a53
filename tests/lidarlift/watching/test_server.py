"""The page of a run's progress: what it answers, and what it refuses."""

from __future__ import annotations

import http.client
import json
import socket
from collections.abc import Iterator
from typing import Any

import pytest

from lidarlift.watching.server import HEADERS, PAGE, ProgressServer, address_of, names_this_machine
from slam.data.errors import InputError

asked: list[tuple[int, int, int]] = []


def state(*since: int) -> dict[str, Any]:
    asked.append(since)  # type: ignore[arg-type]
    return {"frames": 7}


@pytest.fixture
def server() -> Iterator[ProgressServer]:
    asked.clear()
    with ProgressServer(state) as started:
        yield started


def request(server: ProgressServer, path: str, method: str = "GET", host: str | None = None) -> tuple[int, bytes, Any]:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=5)
    connection.putrequest(method, path, skip_host=True)
    connection.putheader("Host", host if host is not None else f"127.0.0.1:{server.port}")
    connection.endheaders()
    answer = connection.getresponse()
    found = answer.status, answer.read(), answer.headers
    connection.close()
    return found


def test_the_page_and_the_progress(server: ProgressServer) -> None:
    assert server.url == f"http://127.0.0.1:{server.port}/"
    for path, (name, kind) in PAGE.items():
        status, content, headers = request(server, path)
        assert (status, headers["Content-Type"]) == (200, kind), name
        assert len(content) > 500
        assert {name: headers[name] for name in HEADERS} == HEADERS
        assert request(server, path, "HEAD")[:2] == (200, b"")
    status, content, _ = request(server, "/progress.json?version=3&frames=5&parts=2")
    assert (status, json.loads(content)) == (200, {"frames": 7})
    request(server, "/progress.json")
    request(server, "/progress.json?frames=-5")
    assert asked == [(3, 5, 2), (-1, 0, 0), (-1, 0, 0)]


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE"])
def test_nothing_can_be_written(server: ProgressServer, method: str) -> None:
    assert request(server, "/", method)[0] == 501


@pytest.mark.parametrize(
    "path",
    [
        "/server.py",
        "/../server.py",
        "/page.js/../../server.py",
        "/%2e%2e/server.py",
        "//etc/passwd",
        "/page/",
        "/index.html",
    ],
)
def test_only_the_pages_files_are_there(server: ProgressServer, path: str) -> None:
    assert request(server, path)[0] == 404


@pytest.mark.parametrize("query", ["version=x", "frames=1e3", "a=1&b=2&c=3&d=4", "parts=" + "9" * 5000])
def test_a_query_that_makes_no_sense_is_refused(server: ProgressServer, query: str) -> None:
    assert request(server, f"/progress.json?{query}")[0] == 400
    assert asked == []


@pytest.mark.parametrize(
    ("host", "answer"),
    [
        ("localhost:8080", 200),
        ("LOCALHOST", 200),
        ("127.0.0.1", 200),
        ("[::1]:8080", 200),
        ("evil.example", 421),
        ("evil.example:8080", 421),
        ("127.0.0.1.evil.example", 421),
        ("localhost.evil.example", 421),
        ("", 421),
    ],
)
def test_other_host_names_are_refused(server: ProgressServer, host: str, answer: int) -> None:
    """A foreign page whose name resolves to this address must not read the progress."""
    assert request(server, "/progress.json", host=host)[0] == answer
    assert len(asked) == (answer == 200)


def test_names_of_a_server_for_other_machines() -> None:
    own = socket.gethostname()
    assert names_this_machine(f"{own}:80", "0.0.0.0")
    assert not names_this_machine(f"{own}:80", "127.0.0.1") or own == "localhost"
    assert names_this_machine("192.168.0.7:80", "0.0.0.0")
    assert not names_this_machine("evil.example:80", "0.0.0.0")


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("8080", ("127.0.0.1", 8080)),
        ("0.0.0.0:80", ("0.0.0.0", 80)),
        ("[::1]:80", ("::1", 80)),
        (":80", ("127.0.0.1", 80)),
    ],
)
def test_addresses(text: str, address: tuple[str, int]) -> None:
    assert address_of(text) == address


@pytest.mark.parametrize("text", ["", "http", "99999", "127.0.0.1", "-1", "8080/"])
def test_no_address(text: str) -> None:
    with pytest.raises(InputError, match="give a port from 0 to 65535, as in 8080"):
        address_of(text)


def test_a_port_in_use_is_an_error(server: ProgressServer) -> None:
    with pytest.raises(InputError, match=f"cannot listen on 127.0.0.1 port {server.port} .*choose another port"):
        ProgressServer(state, port=server.port)
    with pytest.raises(InputError, match="cannot listen on nowhere"):
        ProgressServer(state, "nowhere.invalid")
