"""What a camera says that it is and does, by CAMERA_INFORMATION and CAMERA_CAPTURE_STATUS."""

from __future__ import annotations

import math
from dataclasses import dataclass

from aerodaas.drivers.mavlink.wire.link import Message

__all__ = ["CameraModelTold", "CaptureStatus", "camera_model_told", "capture_status"]

_BY_INTERVAL = frozenset({2, 3})
"""CAMERA_CAPTURE_STATUS.image_status: by an interval, idle or just taking one."""
_RECORDING = 1
"""The same, video_status."""
_MOST_NAME = 32
_WIDEST = 179.0
"""Degrees; a pinhole camera sees less."""


@dataclass(frozen=True, slots=True)
class CameraModelTold:
    """Model of a camera, as it tells it."""

    name: str
    """Vendor and model; empty where neither is told."""
    pixels: tuple[int, int] | None
    """Width and height of its pictures; None where they are not told."""
    view: float | None
    """Degrees across its picture; None where lens or sensor are not told."""


@dataclass(frozen=True, slots=True)
class CaptureStatus:
    """Activity of a camera: pictures taken, video, free storage."""

    taken: int
    """Pictures that it ever took, by its own count."""
    interval: float | None
    """Seconds between pictures that it takes by itself; None while it takes none."""
    recording: float | None
    """Seconds for which it has been recording video; None while it records none."""
    free: float | None
    """MiB; None where it is not told."""


def camera_model_told(message: Message) -> CameraModelTold:
    """Read a CAMERA_INFORMATION, whatever it holds."""
    names = [_text(message.vendor_name), _text(message.model_name)]
    width, height = int(message.resolution_h), int(message.resolution_v)
    return CameraModelTold(
        " ".join(dict.fromkeys(name for name in names if name)),
        (width, height) if width and height else None,
        _view(float(message.focal_length), float(message.sensor_size_h)),
    )


def capture_status(message: Message) -> CaptureStatus:
    """Read a CAMERA_CAPTURE_STATUS, whatever it holds."""
    interval, free = float(message.image_interval), float(message.available_capacity)
    return CaptureStatus(
        max(0, int(message.image_count)),
        _positive(interval) if int(message.image_status) in _BY_INTERVAL else None,
        message.recording_time_ms / 1e3 if int(message.video_status) == _RECORDING else None,
        free if math.isfinite(free) and free > 0.0 else None,
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
