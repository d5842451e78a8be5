"""Video devices of this machine: Video4Linux nodes that capture pictures."""

from __future__ import annotations

import fcntl
import os
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

__all__ = ["VideoDevice", "capability", "video_devices"]

# linux/videodev2.h: VIDIOC_QUERYCAP, struct v4l2_capability and its flags.
_QUERY = 0x80685600
_CAPABILITY = struct.Struct("16s32s32sIII12x")
_CAPTURE = 0x00000001
_CAPTURE_PLANES = 0x00001000
_STREAMING = 0x04000000
_OWN_FLAGS = 0x80000000
"""The node's own capabilities are told beside those of the whole device."""


@dataclass(frozen=True)
class VideoDevice:
    """A node that captures."""

    path: str
    """Such as `/dev/video0`."""
    name: str
    """Of the device, as its driver calls it."""


def video_devices(folder: Path = Path("/dev")) -> tuple[list[VideoDevice], list[str]]:
    """Nodes that capture pictures, and why others could not be asked.

    Nothing is captured: each node is opened and asked what it can do.
    """
    nodes = sorted(folder.glob("video*"), key=lambda path: (len(path.name), path.name))
    devices: list[VideoDevice] = []
    notes: list[str] = []
    for path in nodes:
        if not re.fullmatch(r"video\d+", path.name):
            continue
        try:
            devices += _captures(path)
        except PermissionError:
            notes.append(f"{path}: no permission (`sudo usermod -aG video $USER`, then log in)")
        except OSError as error:
            notes.append(f"{path}: {error.strerror}")
    return devices, notes


def _captures(path: Path) -> Iterator[VideoDevice]:
    file = os.open(path, os.O_RDWR | os.O_NONBLOCK)
    try:
        answer = fcntl.ioctl(file, _QUERY, bytes(_CAPABILITY.size))
    finally:
        os.close(file)
    name = capability(answer)
    if name is not None:
        yield VideoDevice(str(path), name)


def capability(answer: bytes) -> str | None:
    """Name of the device in a `struct v4l2_capability` of 104 bytes; None if it captures nothing.

    A camera has further nodes, such as for metadata, and codecs have some, too.
    """
    _, card, _, _, device, node = _CAPABILITY.unpack(answer)
    flags = node if device & _OWN_FLAGS else device
    if not flags & (_CAPTURE | _CAPTURE_PLANES) or not flags & _STREAMING:
        return None
    name: str = card.split(b"\0")[0].decode("utf-8", "replace")
    return name
