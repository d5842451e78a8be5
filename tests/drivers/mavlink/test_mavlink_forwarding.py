"""A ground station at the forwarding address: bytes as they are, both ways."""

from __future__ import annotations

import socket
import time

import pytest

from aerodaas.drivers.mavlink.wire.forwarding import Forwarder

pytestmark = pytest.mark.wall_clock

LOOPBACK = "127.0.0.1"


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
