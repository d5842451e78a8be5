"""What a camera may say of its video, and what of it would be read."""

from __future__ import annotations

from urllib.parse import urlsplit

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.extensions.payload.mavlink.camera_status import SCHEMES, video_stream


def told(uri: bytes, name: bytes = b"", rate: float = 30.0) -> object:
    """A message that came over the wire."""
    sent = mavlink.MAVLink_video_stream_information_message(
        1, 1, 0, 1, rate, 1920, 1080, 0, 0, 0, name[:32], uri[:160]
    )
    return mavlink.MAVLink(None, 1, 100).decode(bytearray(sent.pack(mavlink.MAVLink(None, 1, 100))))


@pytest.mark.parametrize(
    ("uri", "why"),
    [
        (b"rtsp://10.0.0.9:8554/main", ""),
        (b"rtsps://cam.local/a?b=c", ""),
        (b"udp://0.0.0.0:5600", ""),
        (b"tcp://[fe80::1]:5000", ""),
        (b"", "no address"),
        (b"5600", "bare address"),
        (b"/etc/passwd", "bare address"),
        (b"/dev/video0", "bare address"),
        (b"file:///etc/passwd", "not 'file'"),
        (b"http://10.0.0.9/a.m3u8", "not 'http'"),
        (b"concat:rtsp://a|file:///etc/passwd", "characters that none has"),
        (b"rtsp://a/b c", "characters that none has"),
        (b"rtsp://a/\x1b[2J", "characters that none has"),
        (b"rtsp://a:99999/b", "its address is none"),
        (b"rtsp:///etc/passwd", "names no host"),
        (b"rtsp:/etc/passwd", "names no host"),
    ],
)
def test_only_streams_of_the_network_are_read(uri: bytes, why: str) -> None:
    """Each other one with its reason."""
    stream = video_stream(told(uri))
    assert (why in stream.objection) if why else not stream.objection


@given(st.binary(max_size=160), st.binary(max_size=32), st.floats(width=32))
def test_no_word_of_a_camera_is_too_odd(uri: bytes, name: bytes, rate: float) -> None:
    """What is read has a host and one of the schemes; what is shown is printable."""
    stream = video_stream(told(uri, name, rate))
    assert str(stream).isprintable()
    assert str(stream).isascii()
    if not stream.objection:
        parts = urlsplit(stream.uri)
        assert parts.scheme in SCHEMES
        assert parts.hostname
        assert stream.uri == uri.split(b"\0")[0].decode("ascii")
