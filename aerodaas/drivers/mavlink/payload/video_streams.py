"""Where a camera says that its video is to be had, and whether we would go there.

The address is the word of the vehicle's own camera, and no more: it is read only where the
environment file says so, and only if it leads to a stream on the network, never to a file.
"""

from __future__ import annotations

from dataclasses import dataclass
from urllib.parse import urlsplit

from aerodaas.config.secrets import shown_text
from aerodaas.drivers.mavlink.wire.link import Message

__all__ = ["SCHEMES", "VideoStream", "video_stream"]

SCHEMES = frozenset({"rtsp", "rtsps", "udp", "tcp"})
"""Schemes of addresses that are read: streams over the network."""
_MOST_PIXELS = 65_535


@dataclass(frozen=True)
class VideoStream:
    """One stream of a VIDEO_STREAM_INFORMATION."""

    uri: str
    """As it was told; it may hold user and password."""
    name: str
    width: int
    height: int
    rate: float
    """Pictures a second; 0 where it is not told."""
    objection: str = ""
    """Why it is not read; empty if it may be."""

    def __str__(self) -> str:
        """One line for people, without user, password and parameters."""
        size = f", {self.width}x{self.height}" if self.width and self.height else ""
        rate = f", {self.rate:g}/s" if self.rate else ""
        name = f" ({self.name})" if self.name else ""
        not_read = f"; not read: {self.objection}" if self.objection else ""
        return f"{shown_text(self.uri) or 'no address'}{name}{size}{rate}{not_read}"


def video_stream(message: Message) -> VideoStream:
    """Read a VIDEO_STREAM_INFORMATION, whatever it holds."""
    uri = _printable(str(message.uri))
    rate = float(message.framerate)
    return VideoStream(
        uri,
        _printable(str(message.name)),
        min(int(message.resolution_h), _MOST_PIXELS),
        min(int(message.resolution_v), _MOST_PIXELS),
        rate if 0.0 < rate < 1e4 else 0.0,  # noqa: PLR2004 - NaN is neither
        _objection(str(message.uri)),
    )


def _printable(text: str) -> str:
    return "".join(one if one.isascii() and one.isprintable() else "?" for one in text)


def _objection(uri: str) -> str:
    if not uri:
        return "it has no address"
    # FFmpeg has options behind a bar, and playlists of several addresses behind others.
    if not uri.isascii() or not uri.isprintable() or any(one in uri for one in " |\\\"'<>"):
        return "its address holds characters that none has"
    try:
        parts = urlsplit(uri)
        host, _ = parts.hostname, parts.port
    except ValueError:
        return "its address is none"
    if parts.scheme not in SCHEMES:
        return f"only {', '.join(sorted(SCHEMES))} are, not {parts.scheme or 'a bare address'!r}"
    return "" if host else "its address names no host"
