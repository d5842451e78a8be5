"""Transports at their edges: refusals with their reasons, cuts that are mended, odd packets."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import termios
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from aerodaas.drivers.mavlink.wire import transport as module
from aerodaas.drivers.mavlink.wire.transport import Transport, open_transport
from aerodaas.errors import ConfigError, VehicleError

HOST = "127.0.0.1"
EVERYTHING = bytes(range(256))
"""Each byte once: what a terminal would take for a line's end, an interrupt or a pause as well."""


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The transports' clock."""
    moved = SimpleNamespace(now=50.0)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: moved.now))
    return moved


def heard(wire: Transport) -> list[bytes]:
    """What has come, once anything has."""
    assert select.select([wire], [], [], 5.0)[0], "nothing came within five seconds"
    return [content for content, _ in wire.receive()]


def port_of(wire: Transport) -> int:
    """The local port."""
    return int(_socket_of(wire).getsockname()[1])


def _socket_of(wire: Transport) -> socket.socket:
    return socket.socket(fileno=os.dup(wire.fileno()))


@pytest.fixture
def pair() -> Iterator[tuple[Transport, Transport]]:
    """A listener, and one that speaks to it."""
    listener = open_transport(f"udpin:{HOST}:0", "a")
    sender = open_transport(f"udpout:{HOST}:{port_of(listener)}", "b")
    yield listener, sender
    listener.close()
    sender.close()


def test_a_listener_answers_those_that_it_is_told_to(pair: tuple[Transport, Transport]) -> None:
    """Each of them; a sender hears no one else, and neither waits for what has not come."""
    listener, sender = pair
    assert listener.receive() == sender.receive() == []
    other = open_transport(f"udpout:{HOST}:{port_of(listener)}", "c")
    sender.send(EVERYTHING, ())
    assert heard(listener) == [EVERYTHING]
    peers = [(HOST, port_of(sender)), (HOST, port_of(other))]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(b"a stranger's word", peers[0])
    listener.send(b"to both", (None, *peers))
    assert heard(sender) == heard(other) == [b"to both"]
    listener.send(b"to none", ())
    listener.send(b"to one", (peers[1],))
    assert heard(other) == [b"to one"]
    assert sender.receive() == []
    other.close()


def test_a_peer_that_was_away_is_heard_again() -> None:
    """The system's word that a packet reached no program hides none that came after it."""
    listener = open_transport(f"udpin:{HOST}:0", "a")
    port = port_of(listener)
    sender = open_transport(f"udpout:{HOST}:{port}", "b")
    listener.close()
    sender.send(b"lost", ())
    assert select.select([sender], [], [], 5.0)[0], "the refusal is told"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as back:
        back.bind((HOST, port))
        back.sendto(b"here again", (HOST, port_of(sender)))
        assert heard(sender) == [b"here again"]
        sender.send(b"lost as well", ())
        assert back.recv(100) == b"lost as well"
    sender.send(b"lost", ())
    select.select([sender], [], [], 5.0)
    sender.send(b"refused, and no failure of the link", ())
    sender.close()


def test_a_tcp_line_is_tried_again_each_second(clock: SimpleNamespace) -> None:
    """While it is cut nothing is sent, nothing raises, and the server is left alone meanwhile."""
    with socket.create_server((HOST, 0)) as server:
        server.settimeout(5.0)
        port = server.getsockname()[1]
        wire = open_transport(f"tcp:{HOST}:{port}", "a")
        with _socket_of(wire) as ours:
            assert ours.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY) == 1
        assert wire.receive() == []
        with server.accept()[0] as client:
            wire.send(EVERYTHING, ())
            assert client.recv(1000) == EVERYTHING
            client.sendall(b"hello")
            assert heard(wire) == [b"hello"]
        assert heard(wire) == []
        assert wire.fileno() == -1
        wire.send(b"nowhere", ())
    clock.now += 1.0
    assert wire.receive() == []
    assert wire.fileno() == -1, "the server is gone"
    with socket.create_server((HOST, port)) as server:
        server.settimeout(5.0)
        clock.now += 0.99
        wire.receive()
        assert wire.fileno() == -1
        clock.now += 0.01
        assert wire.receive() == []
        assert wire.fileno() != -1
        with server.accept()[0] as client:
            client.sendall(b"mended")
            assert heard(wire) == [b"mended"]
        wire.close()
        wire.close()
        assert wire.fileno() == -1


@pytest.mark.parametrize("baud", [57600, 115200, 921600])
def test_a_serial_line_is_raw_at_its_speed(baud: int) -> None:
    """No byte is taken for a command to a terminal, in either direction."""
    master, slave = os.openpty()
    wire = open_transport(f"serial:{os.ttyname(slave)}:{baud}", "a")
    attributes = termios.tcgetattr(slave)
    assert attributes[4] == attributes[5] == getattr(termios, f"B{baud}")
    assert wire.receive() == []
    os.write(master, EVERYTHING)
    got = b""
    while len(got) < len(EVERYTHING):
        got += b"".join(heard(wire))
    assert got == EVERYTHING
    wire.send(EVERYTHING, ())
    assert os.read(master, 1000) == EVERYTHING
    wire.close()
    wire.close()
    assert wire.fileno() == -1
    for end in (master, slave):
        os.close(end)


def _numbered(count: int) -> list[bytes]:
    """Packets of 97 bytes, each of which says which it is."""
    return [b"<" + f"{number:05}".encode() * 19 + b">" for number in range(count)]


def _whole(stream: bytes) -> list[bytes]:
    """The packets in a stream that has nothing else in it; the last may be without its end."""
    pieces = [b"<" + piece for piece in stream.split(b"<")[1:]]
    assert b"".join(pieces) == stream
    known = set(_numbered(20000))
    assert set(pieces[:-1]) <= known
    assert pieces[-1] in {one[: len(pieces[-1])] for one in known}
    return pieces


def test_a_full_tcp_line_gets_whole_packets() -> None:
    """The same of a peer that reads too slowly."""
    with socket.create_server((HOST, 0)) as server:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        server.settimeout(5.0)
        wire = open_transport(f"tcp:{HOST}:{server.getsockname()[1]}", "a")
        client = server.accept()[0]
        client.settimeout(0.2)
        with socket.socket(fileno=os.dup(wire.fileno())) as same:
            same.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 8192)
        packets, got = _numbered(20000), b""
        for part in (packets[:-10], packets[-10:]):
            for packet in part:
                wire.send(packet, ())
            with contextlib.suppress(TimeoutError):
                while True:
                    got += client.recv(1 << 20)
        received = _whole(got)
        assert received[-1] == packets[-1]
        assert len(received) < len(packets), "the line was never full"
        wire.close()
        client.close()


def test_a_serial_device_that_is_pulled_out_is_opened_again(
    clock: SimpleNamespace, tmp_path: Path
) -> None:
    """A second after the cut and each second from then on; colons in its name are its own."""
    device = tmp_path / "pci-0000:00:14.0-usb-0:1.2"
    master, slave = os.openpty()
    device.symlink_to(os.ttyname(slave))
    wire = open_transport(f"serial:{device}:57600", "a")
    os.close(slave)
    os.close(master)
    device.unlink()
    assert heard(wire) == []
    assert wire.fileno() == -1
    wire.send(b"nowhere", ())
    clock.now += 1.0
    assert wire.receive() == []
    assert wire.fileno() == -1, "it is still away"
    master, slave = os.openpty()
    device.symlink_to(os.ttyname(slave))
    clock.now += 0.99
    wire.receive()
    assert wire.fileno() == -1
    clock.now += 0.01
    wire.receive()
    assert wire.fileno() != -1
    os.write(master, EVERYTHING)
    assert b"".join(heard(wire)) == EVERYTHING
    wire.close()
    for end in (master, slave):
        os.close(end)


def test_why_an_address_cannot_be_opened_is_said(tmp_path: Path) -> None:
    """With the robot, the address and what to do; nothing is left open."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind((HOST, 0))
        port = taken.getsockname()[1]
        with pytest.raises(VehicleError) as refused:
            open_transport(f"udpin:{HOST}:{port}", "my drone")
    assert str(refused.value).startswith(f"my drone: cannot open udpin:{HOST}:{port}: port {port} ")
    with socket.create_server((HOST, 0)) as server:
        free = server.getsockname()[1]
    plain = tmp_path / "no_terminal"
    plain.write_bytes(b"")
    before = len(list(Path("/proc/self/fd").iterdir()))
    for url, why in (
        (f"tcp:{HOST}:{free}", "no program listens there"),
        (f"serial:{tmp_path}/none:57600", "no such device"),
        (f"serial:{plain}:57600", "cannot open"),
        (f"serial:{plain}:12345", "12345 is no speed of a serial line"),
        ("udpin:203.0.113.7:14550", "no address of this host"),
        ("udpout:no..name:14550", "no..name"),
        ("serial:/dev/\0:57600", "null"),
    ):
        with pytest.raises(VehicleError, match=why):
            open_transport(url, "a")
    assert len(list(Path("/proc/self/fd").iterdir())) == before


@pytest.mark.parametrize(
    "url",
    [
        *("", "udpin", "udpin:host", "udpin:host:port", "pigeon:host:1", "tcp::1", "tcp::", ":h:1"),
        *("udpout:host:-1", "udpout:host:1.5", "serial:/dev/ttyUSB0", "serial::57600", "UDPIN:h:1"),
        pytest.param("tcp:host:" + "9" * 5000, id="a port without end"),
    ],
)
def test_what_is_no_address_is_refused_with_the_forms_of_one(url: str) -> None:
    """Before anything is opened."""
    with pytest.raises(ConfigError, match=r"^a: '.*' is no address; write udpin:HOST:PORT"):
        open_transport(url, "a")


@pytest.mark.parametrize("kind", ["udpin", "udpout", "tcp"])
def test_a_port_that_there_is_not_is_no_other_port(kind: str) -> None:
    """65536 and more is refused: the system would take it for one less by so much."""
    with pytest.raises(ConfigError, match="99999 is too large, 65535 is the largest"):
        open_transport(f"{kind}:{HOST}:99999", "a")


def test_a_full_serial_line_gets_whole_packets() -> None:
    """What has no room is dropped whole: half a packet would take the next one with it."""
    master, slave = os.openpty()
    wire = open_transport(f"serial:{os.ttyname(slave)}:57600", "a")
    packets, got = _numbered(3000), b""
    os.set_blocking(master, False)
    for number, packet in enumerate(packets):
        wire.send(packet, ())
        if number % 300 == 299:
            with contextlib.suppress(BlockingIOError):
                while True:
                    got += os.read(master, 1000)
    received = _whole(got)
    assert 100 < len(received) < len(packets), "the line was never full"
    wire.close()
    for end in (master, slave):
        os.close(end)
