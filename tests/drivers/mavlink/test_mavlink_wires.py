"""UDP, TCP and serial lines: what goes in comes out, and a wire that was cut is mended."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable

import pytest

from aerodaas.drivers.mavlink.wire.forwarding import Forwarder
from aerodaas.drivers.mavlink.wire.transport import Transport, open_transport
from aerodaas.types.errors import ConfigError, VehicleError

pytestmark = pytest.mark.wall_clock

LOOPBACK = "127.0.0.1"


def _received(wire: Transport, wanted: bytes, meanwhile: Callable[[], object] = time.time) -> bool:
    """Wait until `wanted` has come."""
    deadline = time.monotonic() + 10.0
    got = b""
    while wanted not in got and time.monotonic() < deadline:
        meanwhile()
        got += b"".join(content for content, _ in wire.receive())
        time.sleep(0.02)
    return wanted in got


def test_udp_both_ways() -> None:
    """A listener answers to who spoke; a sender hears only the one that it speaks to."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        listener = open_transport(f"udpin:{LOOPBACK}:0", "a")
        port = socket.socket(fileno=os.dup(listener.fileno())).getsockname()[1]
        sender = open_transport(f"udpout:{LOOPBACK}:{port}", "b")
        sender.send(b"hello", ())
        time.sleep(0.1)
        ((content, peer),) = listener.receive()
        assert content == b"hello"
        listener.send(b"answer", (peer, None))
        assert _received(sender, b"answer")
        assert peer is not None
        stranger.sendto(b"psst", peer)
        time.sleep(0.1)
        assert sender.receive() == []
        listener.close()
        sender.send(b"to nobody", ())
        time.sleep(0.1)
        assert sender.receive() == []
        sender.close()


def test_tcp_is_mended() -> None:
    """When the server goes and comes back, so does the wire, without an exception."""
    with socket.create_server((LOOPBACK, 0)) as server:
        port = server.getsockname()[1]
        wire = open_transport(f"tcp:{LOOPBACK}:{port}", "a")
        with server.accept()[0] as client:
            client.sendall(b"one")
            assert _received(wire, b"one")
            wire.send(b"two", ())
            assert client.recv(10) == b"two"
        wire.receive()
        assert wire.fileno() == -1
        wire.send(b"into the void", ())
        server.settimeout(0.01)
        clients: list[socket.socket] = []

        def accept() -> None:
            try:
                clients.append(server.accept()[0])
                clients[-1].sendall(b"three")
            except TimeoutError:
                return

        assert _received(wire, b"three", accept)
        wire.close()
        for one in clients:
            one.close()


def test_a_serial_line() -> None:
    """Raw bytes both ways at the speed that was asked for."""
    master, slave = os.openpty()
    try:
        name = os.ttyname(slave)
        wire = open_transport(f"serial:{name}:57600", "a")
        os.write(master, b"\xfd\x03\x0a\x0d\x11")
        assert _received(wire, b"\xfd\x03\x0a\x0d\x11")
        wire.send(b"\xfe\x0a\x13", ())
        assert os.read(master, 10) == b"\xfe\x0a\x13"
        wire.close()
        with pytest.raises(VehicleError, match="no speed of a serial line"):
            open_transport(f"serial:{name}:12345", "a")
    finally:
        os.close(master)
        os.close(slave)


@pytest.mark.parametrize(
    "url", ["", "udpin", "udpin:host", "udpin:h:p", "carrier:pigeon:1", "tcp::"]
)
def test_addresses_that_are_none(url: str) -> None:
    """Said with the forms that there are."""
    with pytest.raises(ConfigError, match="udpin:HOST:PORT"):
        open_transport(url, "a")
    with pytest.raises((ConfigError, VehicleError)):
        open_transport("udpin:127.0.0.1:99999", "a")


def test_forwarding_is_bytes_as_they_are() -> None:
    """Both ways, unread."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind((LOOPBACK, 0))
        station.settimeout(5.0)
        forwarder = Forwarder(f"udpout:{LOOPBACK}:{station.getsockname()[1]}", "a", lambda: True)
        forwarder.send(b"\xfd anything")
        content, ours = station.recvfrom(100)
        assert content == b"\xfd anything"
        station.sendto(b"back", ours)
        time.sleep(0.1)
        assert forwarder.receive(0.0) == [b"back"]
        forwarder.close()
