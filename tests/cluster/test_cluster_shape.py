"""Words of links, and the wire that delays and loses packets, without a network."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.errors import ConfigError
from tools.namespaces.relay import RelayDirection
from tools.namespaces.shape import Shape, parse_bandwidth, parse_time

pytestmark = pytest.mark.wall_clock


@pytest.mark.parametrize(
    ("text", "seconds"), [("40ms", 0.04), ("0.5s", 0.5), (" 200US ", 0.0002), ("0ms", 0.0)]
)
def test_times(text: str, seconds: float) -> None:
    """A number and a unit."""
    assert parse_time(text) == pytest.approx(seconds)


@pytest.mark.parametrize(("text", "bits"), [("50mbit", 5e7), ("1 gbit", 1e9), ("800kbit", 8e5)])
def test_bandwidths(text: str, bits: float) -> None:
    """A number and a unit."""
    assert parse_bandwidth(text) == pytest.approx(bits)


@pytest.mark.parametrize("text", ["", "40", "ms", "-1ms", "40 parsecs", "1e3ms"])
def test_what_is_no_time(text: str) -> None:
    """The message shows how it is written."""
    with pytest.raises(ConfigError, match="40ms"):
        parse_time(text)


@pytest.mark.parametrize("words", [{"rtt": -0.1}, {"bandwidth": 0.0}, {"loss": 1.1}])
def test_impossible_shapes(words: dict[str, float]) -> None:
    """Refused before any device is touched."""
    with pytest.raises(ConfigError):
        Shape(**words)


@pytest.fixture
def ends() -> Iterator[tuple[RelayDirection, socket.socket, socket.socket]]:
    """A wire between two sockets that keep packets apart, as network devices do."""
    pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in range(2)]
    for pair in pairs:
        for end in pair:
            end.setblocking(False)  # noqa: FBT003
    (near, source), (sink, far) = pairs
    yield RelayDirection(source.fileno(), sink.fileno()), near, far
    for pair in pairs:
        for end in pair:
            end.close()


def arrived(far: socket.socket) -> list[bytes]:
    """Packets that have come through."""
    packets: list[bytes] = []
    with suppress(BlockingIOError):
        while True:
            packets.append(os.read(far.fileno(), 100))
    return packets


def test_a_packet_waits_its_delay(
    ends: tuple[RelayDirection, socket.socket, socket.socket],
) -> None:
    """Not a moment less, and `due` says when."""
    wire, near, far = ends
    wire.delay = 0.02
    near.send(b"one")
    wire.take(10.0)
    assert wire.due == pytest.approx(10.02)
    wire.give(10.019)
    assert arrived(far) == []
    wire.give(10.02)
    assert arrived(far) == [b"one"]
    assert wire.due is None


def test_order_is_kept_when_the_delay_shrinks(
    ends: tuple[RelayDirection, socket.socket, socket.socket],
) -> None:
    """A later packet never overtakes."""
    wire, near, far = ends
    for number, delay in enumerate([0.4, 0.02, 0.0]):
        wire.delay = delay
        near.send(str(number).encode())
        wire.take(float(number) / 100)
    wire.give(0.39)
    assert arrived(far) == []
    wire.give(0.4)
    assert arrived(far) == [b"0", b"1", b"2"]


@given(loss=st.floats(0.0, 1.0), seed=st.integers(0, 99))
def test_the_share_that_is_lost(loss: float, seed: int) -> None:
    """Close to what was asked for, and all or nothing at the ends."""
    count = 400
    pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in range(2)]
    (near, source), (sink, far) = pairs
    try:
        for end in (near, source, sink, far):
            end.setblocking(False)  # noqa: FBT003
        wire = RelayDirection(source.fileno(), sink.fileno(), seed)
        wire.loss = loss
        came = 0
        for _ in range(count):
            near.send(b"x")
            wire.take(0.0)
            wire.give(0.0)
            came += len(arrived(far))
    finally:
        for pair in pairs:
            for end in pair:
                end.close()
    assert abs(came / count - (1.0 - loss)) < 0.13
    if loss in {0.0, 1.0}:
        assert came == count * (1 - loss)
