"""A listening Unix socket is this user's alone, takes so many at once, and ends when closed."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from waiting import until

from aerodaas.unix_server import UnixServer, fits_a_socket

MOST = 2


def echo(connection: socket.socket) -> None:
    """Send back what comes, until the other end has gone."""
    while data := connection.recv(16):
        connection.sendall(data)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Of a socket, where another thing was left."""
    path = tmp_path / "socket"
    path.write_text("left behind")
    return path


@pytest.fixture
def server(path: Path) -> Iterator[UnixServer]:
    """A server of echoes."""
    server = UnixServer(path, echo, name="echo", most=MOST)
    server.start()
    yield server
    server.close()


def connect(path: Path) -> socket.socket:
    """A connection that waits for nothing longer than two seconds."""
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connection.settimeout(2.0)
    connection.connect(str(path))
    return connection


def answers(connection: socket.socket) -> bool:
    """Whether a connection is served; one that is refused is closed without a word."""
    try:
        connection.sendall(b"hello")
        return connection.recv(16) == b"hello"
    except OSError:
        return False


@pytest.mark.usefixtures("server")
def test_it_is_this_users_alone(path: Path) -> None:
    """In the place of whatever was there."""
    assert path.is_socket()
    assert path.stat().st_mode & 0o777 == 0o600


@pytest.mark.usefixtures("server")
def test_one_more_than_it_takes_is_refused_until_another_has_gone(path: Path) -> None:
    """Those that it has are served meanwhile."""
    taken = [connect(path) for _ in range(MOST)]
    assert all(map(answers, taken))
    with connect(path) as more:
        assert not answers(more)
    assert all(map(answers, taken))
    taken.pop().close()

    def served() -> bool:
        with connect(path) as later:
            return answers(later)

    until(served)
    for one in taken:
        one.close()


def test_what_serves_and_raises_gives_its_place_back(path: Path) -> None:
    """Its connection ends, and others are served."""
    calls = []

    def serve(connection: socket.socket) -> None:
        calls.append(1)
        if len(calls) <= MOST:
            raise OSError("broken")
        echo(connection)

    server = UnixServer(path, serve, name="echo", most=1)
    server.start()
    excepthook, threading.excepthook = threading.excepthook, lambda _: None
    try:

        def served() -> bool:
            with connect(path) as one:
                return answers(one)

        until(served)
    finally:
        threading.excepthook = excepthook
        server.close()


def test_a_closed_one_accepts_nobody(server: UnixServer, path: Path) -> None:
    """And ends the connections that it has."""
    open_one = connect(path)
    assert answers(open_one)
    server.close()
    assert open_one.recv(16) == b""
    open_one.close()
    assert server.closed.is_set()
    with pytest.raises(OSError, match="refused"):
        connect(path)


def test_a_path_that_is_too_long_is_known_before() -> None:
    """By its bytes."""
    assert fits_a_socket(Path("/" + "a" * 99))
    assert not fits_a_socket(Path("/" + "a" * 100))
    assert not fits_a_socket(Path("/" + "\N{LATIN SMALL LETTER A WITH DIAERESIS}" * 50))
