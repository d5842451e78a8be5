"""Codec of frames for another node: JPEG, PNG, or pixels as they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from aerodaas.errors import SourceError
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.serialization.records import fast_pickle

__all__ = ["Codec", "CodedFrame", "decoded", "load"]

_JPEG_QUALITY = 90
"""1 to 100: little of a picture is lost, at a tenth of the bytes of its pixels."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class CodedFrame:
    """A frame with a compressed image."""

    header: Header
    data: NDArray[np.uint8]
    """Bytes of the JPEG or PNG file."""
    camera: CameraModel | None
    odometry: Odometry | None
    depth: NDArray[np.uint8] | None = None
    """Bytes of the PNG file of the depth; None without depth."""


@dataclass(frozen=True)
class Codec:
    """Codec of the frames for one compute resource, as configured (`ComputeConfig`)."""

    compression: Literal["jpeg", "png", "none"] = "jpeg"

    def encoded(self, frame: Frame) -> Frame | CodedFrame:
        """The frame to be sent; exact, depth included, except for the image of a JPEG."""
        if self.compression == "none":
            return frame
        image = _jpeg(frame.image) if self.compression == "jpeg" else _png(frame.image)
        depth = None if frame.depth is None else _png(frame.depth)
        return CodedFrame(frame.header, image, frame.camera, frame.odometry, depth)

    def __str__(self) -> str:
        """Its name in recordings."""
        return "raw" if self.compression == "none" else self.compression


def load() -> None:
    """Load OpenCV now: coding is timed, and the first frame's must not take a second.

    Not with this module, which the application imports to plan a flight.
    """
    import cv2  # noqa: F401, PLC0415


def decoded(item: Frame | CodedFrame) -> Frame:
    """Decoded frame; raises SourceError for damaged data."""
    if isinstance(item, Frame):
        return item
    import cv2  # noqa: PLC0415 - see `load`

    image = cv2.imdecode(item.data, cv2.IMREAD_COLOR)
    depth = None if item.depth is None else cv2.imdecode(item.depth, cv2.IMREAD_UNCHANGED)
    if image is None or (item.depth is not None and depth is None):
        raise SourceError(f"frame {item.header.id} of {item.header.source} arrived damaged")
    measured = None if depth is None else np.asarray(depth, np.uint16)
    return Frame(item.header, np.asarray(image, np.uint8), item.camera, item.odometry, measured)


def _jpeg(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    import cv2  # noqa: PLC0415 - see `load`

    _, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return np.asarray(data, np.uint8).ravel()


def _png(pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> NDArray[np.uint8]:
    import cv2  # noqa: PLC0415 - see `load`

    # PNG's fastest settings: they halve 640 x 360 pixels in 12 ms on one core.
    fastest = [cv2.IMWRITE_PNG_COMPRESSION, 1]
    fastest += [cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE]
    _, data = cv2.imencode(".png", pixels, fastest)
    return np.asarray(data, np.uint8).ravel()
