"""The channel between processes of a flight: whole messages within their bounds, or an error."""

from __future__ import annotations

import socket
import struct

import pytest

from aerodaas.analytics.here.relay import LARGEST_TEXT, Channel, ChannelError


@pytest.mark.parametrize(
    "data",
    [
        struct.pack("<II", LARGEST_TEXT + 1, 0),
        struct.pack("<II", 2, 2**32 - 1) + b"{}",
        struct.pack("<II", 2, 0) + b"[]",
        struct.pack("<II", 4, 0) + b"\xff\xfe{}",
        struct.pack("<II", 100_000, 0) + b"[" * 100_000,
        struct.pack("<II", 50, 0) + b"{",
        b"abc",
        b"",
    ],
)
def test_malformed_messages_are_refused(data: bytes) -> None:
    """Before their size is believed, and when they end early."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        theirs.sendall(data)
        theirs.close()
        with pytest.raises(ChannelError):
            Channel(ours).receive(2.0)


def test_a_message_that_drips_is_cut_off() -> None:
    """The time is for the whole message, not for each byte."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        theirs.sendall(struct.pack("<II", 50, 0))
        with pytest.raises(ChannelError, match="in time"):
            Channel(ours).receive(0.2)
