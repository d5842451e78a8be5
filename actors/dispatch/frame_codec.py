"""How a frame travels to another node: as it is, as JPEG or as PNG, whichever arrives first.

Nothing is assumed: what a coding takes and saves is measured on the very pictures, what a byte
costs on the link is measured, too (`_costs`), and the sum decides.
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
"""Codings that a setting of `ComputeConfig.compression` allows; of equals the first is taken."""
_WRITING: dict[Coding, tuple[str, list[int]]] = {
    "jpeg": (".jpg", [cv2.IMWRITE_JPEG_QUALITY, 90]),
    # Of PNG's settings the quickest: of 640 x 360 pixels it leaves half in 12 ms of one core.
    "png": (
        ".png",
        [
            *(cv2.IMWRITE_PNG_COMPRESSION, 1),
            *(cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE),
        ],
    ),
}
_REMEASURED = 64
"""After so many frames, a coding that was not chosen is measured again."""
_WEIGHT = 0.3
"""Of the newest measurement in a running average."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class CodedFrame:
    """A frame whose image is compressed."""

    header: Header
    data: NDArray[np.uint8]
    """The file's bytes."""
    coding: Coding
    camera: CameraModel | None
    odometry: Odometry | None
    depth: NDArray[np.uint8] | None = None
    """The bytes of a PNG file, where the camera measured depth."""


@dataclass(frozen=True)
class CodingCost:
    """The cost of a coding for an image."""

    size: float
    """Bytes that travel."""
    encode: float
    """Seconds."""
    decode: float
    """Seconds, at the other end."""

    @property
    def seconds(self) -> float:
        """Seconds of work at both ends."""
        return self.encode + self.decode


def fastest(
    costs: Mapping[Coding, CodingCost], link: Callable[[float], float]
) -> tuple[Coding, float]:
    """The coding with which an image arrives first, and the seconds until then.

    `link` gives the seconds that a number of bytes is on its way.
    """
    totals: dict[Coding, float] = {
        coding: cost.seconds + link(cost.size) for coding, cost in costs.items()
    }
    best = min(totals, key=lambda coding: totals[coding])
    return best, totals[best]


def decoded(item: Frame | CodedFrame) -> Frame:
    """The decoded frame; raises SourceError for data that is no image."""
    if isinstance(item, Frame):
        return item
    image = cv2.imdecode(item.data, cv2.IMREAD_COLOR)
    depth = None if item.depth is None else cv2.imdecode(item.depth, cv2.IMREAD_UNCHANGED)
    if image is None or (item.depth is not None and depth is None):
        raise SourceError(f"frame {item.header.id} of {item.header.source} arrived damaged")
    measured = None if depth is None else np.asarray(depth, np.uint16)
    return Frame(item.header, np.asarray(image, np.uint8), item.camera, item.odometry, measured)


class Coder:
    """Measures the cost of each coding for each camera's images. One thread at a time."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, tuple[int, ...]], dict[Coding, CodingCost]] = {}
        self._count = 0

    def costs(self, frame: Frame, allowed: tuple[Coding, ...]) -> dict[Coding, CodingCost]:
        """The cost of each allowed coding for images like this one, measured at the first one."""
        known = self._known.setdefault((frame.header.source, frame.image.shape), {})
        for coding in allowed:
            if coding not in known:
                self.encode(frame, coding)
        self._count += 1
        if self._count % _REMEASURED == 0:
            self.encode(frame, allowed[self._count // _REMEASURED % len(allowed)])
        return {coding: known[coding] for coding in allowed}

    def encode(self, frame: Frame, coding: Coding) -> Frame | CodedFrame:
        """Code a frame, and learn from it."""
        if coding == "raw":
            self._learn(frame, coding, CodingCost(frame.nbytes, 0.0, 0.0))
            return frame
        began = time.perf_counter()
        data = _written(frame.image, coding)
        depth = None if frame.depth is None else _written(frame.depth, "png")
        took = time.perf_counter() - began
        # Until the other end has told, decoding is taken to last as long as encoding.
        size = data.nbytes + (0 if depth is None else depth.nbytes)
        self._learn(frame, coding, CodingCost(size, took, took))
        return CodedFrame(frame.header, data, coding, frame.camera, frame.odometry, depth)

    def took_to_decode(self, frame: Frame, coding: Coding, seconds: float) -> None:
        """Record the seconds of decoding at the other end."""
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
