"""A picture that is a file already, recorded without decoding it."""

from __future__ import annotations

from dataclasses import dataclass

from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Odometry

__all__ = ["EncodedFrame"]


@dataclass(frozen=True, slots=True)
class EncodedFrame:
    """What a `Frame` is, with its picture encoded."""

    header: Header
    data: bytes
    format: str
    """`jpeg`, `png` or `webp`."""
    width: int
    """Pixels across."""
    height: int
    """Pixels down."""
    camera: CameraModel | None = None
    odometry: Odometry | None = None
