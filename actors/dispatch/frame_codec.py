"""Coding of frames for another node: raw, JPEG or PNG, the one with the least total time.

Sizes and coding times are measured on the actual images, the time per byte on the link
(`costs.py`); the sum decides.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.types.data import Frame, Header, Odometry
from aerodaas.types.errors import SourceError
from aerodaas.types.geometry import CameraModel
from aerodaas.types.records import fast_pickle

__all__ = ["CODINGS", "CodedFrame", "Coder", "Coding", "CodingCost", "decoded", "fastest"]

Coding = Literal["raw", "jpeg", "png"]
CODINGS: dict[str, tuple[Coding, ...]] = {
    "auto": ("raw", "jpeg", "png"),
    "lossless": ("raw", "png"),
    "none": ("raw",),
}
"""Codings allowed by each `ComputeConfig.compression`; the first of equals is taken."""
_WRITING: dict[Coding, tuple[str, list[int]]] = {
    "jpeg": (".jpg", [cv2.IMWRITE_JPEG_QUALITY, 90]),
    # PNG's fastest settings: they halve 640 x 360 pixels in 12 ms on one core.
    "png": (
        ".png",
        [
            *(cv2.IMWRITE_PNG_COMPRESSION, 1),
            *(cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE),
        ],
    ),
}
_REMEASURED = 64
"""Frames after which another coding is measured again."""
_WEIGHT = 0.3
"""Weight of the newest measurement in a running average."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class CodedFrame:
    """A frame with a compressed image."""

    header: Header
    data: NDArray[np.uint8]
    """Bytes of the JPEG or PNG file."""
    coding: Coding
    camera: CameraModel | None
    odometry: Odometry | None
    depth: NDArray[np.uint8] | None = None
    """Bytes of the PNG file of the depth; None without depth."""


@dataclass(frozen=True)
class CodingCost:
    """Size and times of an image with a coding."""

    size: float
    """Bytes sent."""
    encode: float
    """Seconds of encoding."""
    decode: float
    """Seconds of decoding, at the other end."""

    @property
    def seconds(self) -> float:
        """Seconds of encoding and decoding."""
        return self.encode + self.decode


def fastest(
    costs: Mapping[Coding, CodingCost], link: Callable[[float], float]
) -> tuple[Coding, float]:
    """Coding with the least total time, and this time in seconds.

    `link` returns the transfer time in seconds of a number of bytes.
    """
    totals: dict[Coding, float] = {
        coding: cost.seconds + link(cost.size) for coding, cost in costs.items()
    }
    best = min(totals, key=lambda coding: totals[coding])
    return best, totals[best]


def decoded(item: Frame | CodedFrame) -> Frame:
    """Decoded frame, exact except for JPEG; raises SourceError for damaged data."""
    if isinstance(item, Frame):
        return item
    image = cv2.imdecode(item.data, cv2.IMREAD_COLOR)
    depth = None if item.depth is None else cv2.imdecode(item.depth, cv2.IMREAD_UNCHANGED)
    if image is None or (item.depth is not None and depth is None):
        raise SourceError(f"frame {item.header.id} of {item.header.source} arrived damaged")
    measured = None if depth is None else np.asarray(depth, np.uint16)
    return Frame(item.header, np.asarray(image, np.uint8), item.camera, item.odometry, measured)


class Coder:
    """Encoder with the measured costs of each coding for each camera. Not thread-safe."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, tuple[int, ...]], dict[Coding, CodingCost]] = {}
        self._count = 0

    def costs(self, frame: Frame, allowed: tuple[Coding, ...]) -> dict[Coding, CodingCost]:
        """Costs of each allowed coding for images like this one, measured on the first."""
        known = self._known.setdefault((frame.header.source, frame.image.shape), {})
        for coding in allowed:
            if coding not in known:
                self.encode(frame, coding)
        self._count += 1
        if self._count % _REMEASURED == 0:
            self.encode(frame, allowed[self._count // _REMEASURED % len(allowed)])
        return {coding: known[coding] for coding in allowed}

    def encode(self, frame: Frame, coding: Coding) -> Frame | CodedFrame:
        """Encode a frame and update the costs."""
        if coding == "raw":
            self._learn(frame, coding, CodingCost(frame.nbytes, 0.0, 0.0))
            return frame
        began = time.perf_counter()
        data = _written(frame.image, coding)
        depth = None if frame.depth is None else _written(frame.depth, "png")
        took = time.perf_counter() - began
        # Until decoding is measured, it is assumed to take as long as encoding.
        size = data.nbytes + (0 if depth is None else depth.nbytes)
        self._learn(frame, coding, CodingCost(size, took, took))
        return CodedFrame(frame.header, data, coding, frame.camera, frame.odometry, depth)

    def took_to_decode(self, frame: Frame, coding: Coding, seconds: float) -> None:
        """Update the cost of decoding at the other end."""
        known = self._known.get((frame.header.source, frame.image.shape), {})
        if coding in known:
            old = known[coding]
            known[coding] = CodingCost(old.size, old.encode, _mixed(old.decode, seconds))

    def _learn(self, frame: Frame, coding: Coding, new: CodingCost) -> None:
        known = self._known.setdefault((frame.header.source, frame.image.shape), {})
        old = known.get(coding)
        known[coding] = (
            new
            if old is None
            else CodingCost(_mixed(old.size, new.size), _mixed(old.encode, new.encode), old.decode)
        )


def _written(pixels: NDArray[np.uint8] | NDArray[np.uint16], coding: Coding) -> NDArray[np.uint8]:
    suffix, settings = _WRITING[coding]
    _, data = cv2.imencode(suffix, pixels, settings)
    return np.asarray(data, np.uint8).ravel()


def _mixed(old: float, new: float) -> float:
    return old + _WEIGHT * (new - old)
