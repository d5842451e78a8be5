"""What a camera says that it is and does, by CAMERA_INFORMATION and CAMERA_CAPTURE_STATUS."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from urllib.parse import urlsplit

from aerodaas.config.secrets import shown_text
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import Message
from aerodaas.messages.payload import CameraStatus

__all__ = [
    "SCHEMES",
    "VideoStream",
    "video_stream",
    "with_capture",
    "with_card",
    "with_model",
]

_FULL = 64.0
"""MiB: room for a handful of pictures."""
_TROUBLES = {
    mavlink.STORAGE_STATUS_EMPTY: "it has no card",
    mavlink.STORAGE_STATUS_UNFORMATTED: "its card is not formatted",
}


def with_card(status: CameraStatus, message: Message) -> CameraStatus:
    """`status` with a STORAGE_INFORMATION, whatever it holds."""
    state, free = int(message.status), float(message.available_capacity)
    known = state == mavlink.STORAGE_STATUS_READY and math.isfinite(free) and free >= 0.0
    if known and free < _FULL:
        trouble = f"its card is full: {free:.0f} MiB are left"
    else:
        trouble = _TROUBLES.get(state, "")
    return replace(status, free=free if known else None, trouble=trouble)


_BY_INTERVAL = frozenset({2, 3})
"""CAMERA_CAPTURE_STATUS.image_status: by an interval, idle or just taking one."""
_RECORDING = 1
"""The same, video_status."""
_MOST_NAME = 32
_WIDEST = 179.0
"""Degrees; a pinhole camera sees less."""


def with_model(status: CameraStatus, message: Message) -> CameraStatus:
    """`status` with a CAMERA_INFORMATION, whatever it holds."""
    names = [_text(message.vendor_name), _text(message.model_name)]
    width, height = int(message.resolution_h), int(message.resolution_v)
    return replace(
        status,
        model=" ".join(dict.fromkeys(name for name in names if name)),
        pixels=(width, height) if width and height else None,
        view=_view(float(message.focal_length), float(message.sensor_size_h)),
    )


def with_capture(status: CameraStatus, message: Message) -> CameraStatus:
    """`status` with a CAMERA_CAPTURE_STATUS, whatever it holds."""
    interval, free = float(message.image_interval), float(message.available_capacity)
    records = int(message.video_status) == _RECORDING
    return replace(
        status,
        taken=max(0, int(message.image_count)),
        interval=_positive(interval) if int(message.image_status) in _BY_INTERVAL else None,
        recording=message.recording_time_ms / 1e3 if records else None,
        free=free if status.free is None and 0.0 < free < math.inf else status.free,
    )


def _view(focal_length: float, sensor: float) -> float | None:
    """Degrees; `focal_length` and `sensor` are in mm, NaN or zero where nothing is told."""
    if not (0.0 < focal_length < math.inf and 0.0 < sensor < math.inf):
        return None
    view = math.degrees(2.0 * math.atan2(sensor, 2.0 * focal_length))
    return view if view < _WIDEST else None


def _positive(value: float) -> float:
    """Seconds; 0 for what is none, since the camera takes pictures all the same."""
    return value if math.isfinite(value) and value > 0.0 else 0.0


def _text(characters: list[int]) -> str:
    text = bytes(characters[:_MOST_NAME]).split(b"\0")[0].decode("ascii", "replace")
    return "".join(one if one.isascii() and one.isprintable() else "?" for one in text).strip()


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
