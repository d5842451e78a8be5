"""Connections that ask nothing: closed in time, and nothing else is."""

from __future__ import annotations

import asyncio
import select
import socket
import threading
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import ExitStack, suppress

import pytest
from waiting import until
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from aerodaas.http_server.addresses import App, Receive, Scope, Send, listen
from aerodaas.service.http.limits import RequestLimits
from aerodaas.service.http.server import web_server

pytestmark = pytest.mark.wall_clock

PATIENCE = 0.5
_MOST = 2
_ENOUGH = 10.0
_LARGE = 32 << 20
"""Bytes of an answer, more than the system keeps for a client."""
HEAD = b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 4\r\n\r\n"


async def application(scope: Scope, receive: Receive, send: Send) -> None:
    """Answers a body once it is whole, `/slow` later than a client is waited for."""
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.accept"})
        while (message := await receive())["type"] == "websocket.receive":
            await send({"type": "websocket.send", "text": message["text"]})
        return
    body = b""
    while True:
        message = await receive()
        if message["type"] != "http.request":
            return
        body += message["body"]
        if not message["more_body"]:
            break
    if scope["path"] == "/slow":
        await asyncio.sleep(3 * PATIENCE)
    if scope["path"] == "/large":
        body = bytes(_LARGE)
    length = b"%d" % len(body)
    await send(
        {"type": "http.response.start", "status": 200, "headers": [(b"content-length", length)]}
    )
    await send({"type": "http.response.body", "body": body})


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Port of a server with short patience and two connections."""
    monkeypatch.setattr(RequestLimits, "head_seconds", PATIENCE)
    monkeypatch.setattr(RequestLimits, "body_seconds", PATIENCE)
    monkeypatch.setattr(RequestLimits, "answer_seconds", PATIENCE)
    app: App = application
    server = web_server(
        app, RequestLimits(connections=_MOST + 1), lifespan="off", timeout_keep_alive=60
    )
    with listen("127.0.0.1", 0) as listener:
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        yield listener.getsockname()[1]
        server.should_exit = True
        thread.join(_ENOUGH)
    assert not thread.is_alive()


def client(port: int) -> socket.socket:
    """A connection."""
    return socket.create_connection(("127.0.0.1", port), timeout=_ENOUGH)


def closed_while_dripping(connection: socket.socket, drip: bytes) -> bool:
    """Whether the server closes the connection while one sends it a byte at a time."""
    deadline = time.monotonic() + _ENOUGH
    with suppress(OSError):
        while time.monotonic() < deadline:
            connection.sendall(drip)
            if select.select([connection], [], [], 0.1)[0] and not connection.recv(1000):
                return True
        return False
    return True


def test_a_client_that_says_nothing_is_closed(port: int) -> None:
    """By an end of file, without an answer."""
    with client(port) as silent:
        assert silent.recv(100) == b""


def test_silent_clients_make_room_for_others(port: int) -> None:
    """Who comes when all places are taken waits no longer than they are waited for."""
    silent = [client(port) for _ in range(_MOST)]
    for one in silent:
        assert one.recv(100) == b""
        one.close()
    with client(port) as asking:
        asking.sendall(HEAD + b"body")
        assert asking.recv(1000).startswith(b"HTTP/1.1 200")


def test_a_new_client_takes_the_place_of_the_oldest_that_asks_nothing(
    port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At once, however many come; who has asked, or has a WebSocket, keeps its place."""
    monkeypatch.setattr(RequestLimits, "head_seconds", 10 * _ENOUGH)
    with connect(f"ws://127.0.0.1:{port}/", open_timeout=_ENOUGH) as kept, ExitStack() as stack:
        for _ in range(20):
            stack.enter_context(client(port))
        with client(port) as asking:
            asking.sendall(HEAD + b"body")
            assert asking.recv(1000).startswith(b"HTTP/1.1 200")
        kept.send("still here")
        assert kept.recv(_ENOUGH) == "still here"


def test_room_is_made_at_the_address_with_most_silent_connections(
    port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who connects from elsewhere, once, and has not asked yet, keeps the place."""
    monkeypatch.setattr(RequestLimits, "head_seconds", 10 * _ENOUGH)
    source = ("127.0.0.2", 0)
    with (
        socket.create_connection(("127.0.0.1", port), _ENOUGH, source) as other,
        ExitStack() as stack,
    ):
        for _ in range(20):
            stack.enter_context(client(port))
        other.sendall(HEAD + b"body")
        assert other.recv(1000).startswith(b"HTTP/1.1 200")


def test_headers_that_drip_are_closed(port: int) -> None:
    """More bytes of the same request do not start the clock anew."""
    with client(port) as slow:
        slow.sendall(b"POST / HTTP/1.1\r\nHost: localhost\r\nX-Long: ")
        assert closed_while_dripping(slow, b"a")


def test_a_body_that_drips_is_closed(port: int) -> None:
    """The request has arrived, and its body never does."""
    with client(port) as slow:
        slow.sendall(HEAD.replace(b"Length: 4", b"Length: 4000"))
        assert closed_while_dripping(slow, b"b")


def test_a_further_request_is_waited_for_no_longer(port: int) -> None:
    """A connection that has asked once properly is not trusted more."""
    with client(port) as slow:
        slow.sendall(HEAD + b"body")
        assert slow.recv(1000).startswith(b"HTTP/1.1 200")
        slow.sendall(b"POST / HTTP/1.1\r\nX-Long: ")
        assert closed_while_dripping(slow, b"a")


def test_an_answer_may_take_longer(port: int) -> None:
    """The clock is the client's, not the application's."""
    with client(port) as patient:
        patient.sendall(HEAD.replace(b"POST /", b"POST /slow") + b"body")
        answer = b""
        while chunk := patient.recv(1000):
            answer += chunk
            if answer.endswith(b"body"):
                break
        assert answer.startswith(b"HTTP/1.1 200")
        assert answer.endswith(b"body")


def test_clients_that_take_no_answer_make_room_for_others(port: int) -> None:
    """Also at its end, when the server waits for nothing but its last bytes to leave."""
    greedy = [client(port) for _ in range(_MOST)]
    for one in greedy:
        one.sendall(HEAD.replace(b"POST /", b"POST /large") + b"body")
    until(lambda: _answers(port))
    for one in greedy:
        with suppress(ConnectionError):
            assert len(_rest(one)) < _LARGE
        one.close()


def _answers(port: int) -> bool:
    """Whether there is a place for one more."""
    with client(port) as asking:
        asking.sendall(HEAD + b"body")
        return asking.recv(1000).startswith(b"HTTP/1.1 200")


def _rest(connection: socket.socket) -> bytes:
    """All that comes until the connection ends."""
    found = bytearray()
    while part := connection.recv(1 << 20):
        found += part
    return bytes(found)


def test_an_answer_may_be_taken_slowly(port: int) -> None:
    """It is, as long as some of it is."""
    with client(port) as slow:
        slow.sendall(HEAD.replace(b"POST /", b"POST /large") + b"body")
        taken = 0
        while taken < _LARGE and (part := slow.recv(1 << 18)):
            taken += len(part)
            time.sleep(PATIENCE / 25)
    assert taken > _LARGE


def test_a_body_within_its_time_is_taken(port: int) -> None:
    """Headers in two pieces, and a body in two more."""
    with client(port) as slow:
        for piece in (HEAD[:20], HEAD[20:], b"bo", b"dy"):
            slow.sendall(piece)
            time.sleep(PATIENCE / 8)
        assert slow.recv(1000).startswith(b"HTTP/1.1 200")


@pytest.mark.parametrize("fragmented", [False, True])
def test_a_websocket_message_is_whole_in_time(
    port: int, monkeypatch: pytest.MonkeyPatch, *, fragmented: bool
) -> None:
    """One that never ends closes its connection; further bytes of it do not start the clock."""
    monkeypatch.setattr(RequestLimits, "message_seconds", PATIENCE)
    with connect(f"ws://127.0.0.1:{port}/", open_timeout=_ENOUGH) as slow:
        part = b"\x01\x81\x00\x00\x00\x00a" if fragmented else _masked(200)[:20]
        slow.socket.sendall(part)
        drip = b"\x00\x81\x00\x00\x00\x00a" if fragmented else b"a"
        assert "whole within" in _reason_while_dripping(slow, drip)


def _reason_while_dripping(connection: ClientConnection, drip: bytes) -> str:
    """Why the server closes a connection while one sends it a little again and again."""
    deadline = time.monotonic() + _ENOUGH
    try:
        while time.monotonic() < deadline:
            connection.socket.sendall(drip)
            with suppress(TimeoutError):
                connection.recv(0.02)
    except ConnectionClosed as closed:
        return "" if closed.rcvd is None else closed.rcvd.reason
    return ""


def test_messages_one_after_the_other_are_each_given_their_time(
    port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where a part of the next one comes with the last."""
    monkeypatch.setattr(RequestLimits, "message_seconds", PATIENCE)
    frame = _masked(8)
    with connect(f"ws://127.0.0.1:{port}/", open_timeout=_ENOUGH) as busy:
        busy.socket.sendall(frame[:3])
        for _ in range(10):
            busy.socket.sendall(frame[3:] + frame[:3])
            assert busy.recv(_ENOUGH) == 8 * "a"
            time.sleep(PATIENCE / 4)


def test_unfinished_messages_are_bounded_for_all_together(
    port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The oldest ends; who sends whole messages meanwhile is not touched."""
    monkeypatch.setattr(RequestLimits, "unfinished_bytes", 1000)
    url = f"ws://127.0.0.1:{port}/"
    with connect(url, open_timeout=_ENOUGH) as hoarder, connect(url, open_timeout=_ENOUGH) as other:
        hoarder.socket.sendall(_masked(5000)[:900])
        for _ in range(5):
            other.send("x" * 400)
            assert other.recv(_ENOUGH) == "x" * 400
        other.socket.sendall(_masked(5000)[:500])
        with pytest.raises(ConnectionClosed, match="connect again"):
            hoarder.recv(_ENOUGH)


def test_fragments_of_a_byte_take_no_multiple_of_their_size(port: int) -> None:
    """They are joined as they come, each of them an object of forty bytes."""
    count = 20_000
    with connect(f"ws://127.0.0.1:{port}/", open_timeout=_ENOUGH) as hoarder:
        tracemalloc.start()
        hoarder.socket.sendall(b"\x01\x81\x00\x00\x00\x00a")
        for _ in range(100):
            hoarder.socket.sendall(b"\x00\x81\x00\x00\x00\x00a" * (count // 100))
        assert hoarder.ping().wait(_ENOUGH)
        kept, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert kept < 10 * count


def test_a_server_has_so_many_connections(port: int) -> None:
    """One more is refused while all others have their WebSockets, until one of them ends."""
    with connect(f"ws://127.0.0.1:{port}/", open_timeout=_ENOUGH):
        with connect(f"ws://127.0.0.1:{port}/", open_timeout=_ENOUGH), client(port) as late:
            late.sendall(HEAD + b"body")
            assert late.recv(1000).startswith(b"HTTP/1.1 503")
        until(lambda: _answers(port))


def _masked(size: int) -> bytes:
    """The frame of a text of so many letters `a`, masked by zeros, with its length in two bytes."""
    return b"\x81\xfe" + size.to_bytes(2, "big") + bytes(4) + b"a" * size


def test_a_websocket_stays(port: int) -> None:
    """It is silent for longer than a request may be."""
    with connect(f"ws://127.0.0.1:{port}/", open_timeout=_ENOUGH) as quiet:
        time.sleep(3 * PATIENCE)
        quiet.send("still here")
        assert quiet.recv(_ENOUGH) == "still here"
