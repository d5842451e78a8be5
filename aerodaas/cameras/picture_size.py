"""Format and size of a compressed picture from its first bytes, and its bounds, before decoding."""

from __future__ import annotations

import struct
from typing import Literal

__all__ = [
    "MAX_PIXELS",
    "MAX_SCANS",
    "MAX_SIDE",
    "picture_fits",
    "picture_format",
    "picture_size",
]

MAX_PIXELS = 1 << 25
"""Width times height of a picture, before it is decoded: 8K has 33.2 million, 100 MB as BGR."""
MAX_SIDE = 1 << 14
"""Pixels of a picture along one side, as many as H.264 allows."""
MAX_SCANS = 100
"""Passes of a progressive JPEG. Encoders make ten; each costs the time of a whole picture."""

_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8"
_SCAN = b"\xff\xda"
_FILL = 0xFF
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""JPEG's markers of a frame's header, which holds the size."""
_BARE = frozenset({0x01, *range(0xD0, 0xD8)})
"""JPEG's markers without a length."""


def picture_fits(width: int, height: int) -> bool:
    """Whether a picture of this size may be decoded.

    Args:
        width: Pixels.
        height: Pixels.
    """
    return 0 < width <= MAX_SIDE and 0 < height <= MAX_SIDE and width * height <= MAX_PIXELS


def picture_format(data: bytes) -> Literal["jpeg", "png", "webp"] | None:
    """Format of a compressed picture by its signature; None for any other."""
    if data.startswith(_PNG):
        return "png"
    if data.startswith(_JPEG):
        return "jpeg"
    return "webp" if data[:4] == b"RIFF" and data[8:12] == b"WEBP" else None


def picture_size(data: bytes) -> tuple[int, int] | None:
    """Width and height in pixels of a JPEG, PNG or WebP.

    Args:
        data: The compressed picture.

    Returns:
        The size; None for another format, a damaged header, or a JPEG of more than `MAX_SCANS`
        passes.
    """
    kind = picture_format(data)
    try:
        if kind == "png" and data[12:16] == b"IHDR":
            width, height = struct.unpack_from(">II", data, 16)
            return width, height
        if kind == "jpeg":
            return _jpeg(data) if data.count(_SCAN) <= MAX_SCANS else None
        if kind == "webp":
            return _webp(data)
    except (struct.error, IndexError):
        pass
    return None


def _jpeg(data: bytes) -> tuple[int, int] | None:
    place = len(_JPEG)
    while True:
        # What is between two segments is skipped, as decoders do.
        place = data.find(b"\xff", place)
        if place < 0:
            return None
        while data[place] == _FILL:
            place += 1
        marker = data[place]
        place += 1
        if marker in _FRAMES:
            height, width = struct.unpack_from(">HH", data, place + 3)
            return width, height
        if marker in {0xD9, 0xDA}:
            return None
        if marker and marker not in _BARE:
            (length,) = struct.unpack_from(">H", data, place)
            place += max(2, length)


def _webp(data: bytes) -> tuple[int, int] | None:
    kind = data[12:16]
    if kind == b"VP8X":
        width, height = (int.from_bytes(data[at : at + 3], "little") for at in (24, 27))
        return width + 1, height + 1
    if kind == b"VP8L":
        (bits,) = struct.unpack_from("<I", data, 21)
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    if kind == b"VP8 ":
        width, height = struct.unpack_from("<HH", data, 26)
        return width & 0x3FFF, height & 0x3FFF
    return None
