"""Letterboxing of frames into a network's input, and of boxes back to the frame."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.detection.families.base import Preprocessing
from aerodaas.analytics.detection.model_file import PixelType

__all__ = ["Letterbox"]

_STRIDE = 32


class Letterbox:
    """Mapping between frames of one size and a network input of one size.

    The padding is written once, when the buffer is made; each frame overwrites the inner part
    only. Resizing is bilinear, as in training.
    """

    def __init__(
        self,
        frame: tuple[int, int],
        network: tuple[int, int],
        style: Preprocessing,
        *,
        flexible: bool = False,
    ) -> None:
        """Map frames of `frame` (height, width) pixels to at most `network` (height, width).

        If the input's size is `flexible`, padding beyond the next multiple of 32 is omitted.
        """
        height, width = frame
        ratio = min(network[0] / height, network[1] / width)
        self.inner = (max(1, round(height * ratio)), max(1, round(width * ratio)))
        if style.stretched:
            self.inner = network
        elif flexible:
            network = (_round_up(self.inner[0]), _round_up(self.inner[1]))
        self.frame = frame
        self.network = network
        self.style = style
        slack = (network[0] - self.inner[0], network[1] - self.inner[1])
        # Halves are rounded down, as in Ultralytics' LetterBox.
        self.top, self.left = (slack[0] // 2, slack[1] // 2) if style.centred else (0, 0)

    def buffer(self, count: int, dtype: type[PixelType]) -> NDArray[Any]:
        """Make an input of the network, filled with padding.

        Args:
            count: Number of frames.
            dtype: Type of its elements.

        Returns:
            Array, count x 3 x height x width.
        """
        return np.full((count, 3, *self.network), self.style.fill * self.style.scale, dtype)

    def write(self, image: NDArray[np.uint8], slot: NDArray[Any]) -> None:
        """Resize a picture into a slot of a buffer.

        Args:
            image: Picture, height x width x 3, BGR.
            slot: Slot of the buffer, 3 x height x width.
        """
        height, width = self.inner
        if self.frame != self.inner:
            image = np.asarray(cv2.resize(image, (width, height)), np.uint8)
        planes = cv2.split(image)
        window = slot[:, self.top : self.top + height, self.left : self.left + width]
        scale = slot.dtype.type(self.style.scale)
        for channel, plane in enumerate(reversed(planes) if self.style.rgb else planes):
            np.multiply(plane, scale, out=window[channel], casting="unsafe")

    def restore(self, points: NDArray[np.float32]) -> NDArray[np.float32]:
        """Convert points (..., 2) of the network's input to u and v of the frame, clipped to it."""
        height, width = self.frame
        # Per axis, because rounding to whole pixels scales the two slightly differently.
        scale = np.array([width / self.inner[1], height / self.inner[0]], np.float32)
        moved = (points - np.array([self.left, self.top], np.float32)) * scale
        clipped: NDArray[np.float32] = np.clip(moved, 0, np.array([width, height], np.float32))
        return clipped


def _round_up(length: int) -> int:
    return -(-length // _STRIDE) * _STRIDE
