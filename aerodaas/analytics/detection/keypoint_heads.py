"""Keypoint networks on crops around people: how each crops, normalises and gives its joints.

`CropHead` is that of `tools.training pose`: a square crop, and keypoints [n, 17, 3] as u, v in its
pixels and confidence. `SimccHead` is RTMPose's: a crop of three by four, and for each joint a
distribution over columns [n, 17, k width] and one over rows [n, 17, k height], whose maxima are the
joint's place in k-ths of a pixel. Sources of the latter: Jiang et al. 2023, "RTMPose: Real-Time
Multi-Person Pose Estimation based on MMPose"; open-mmlab/mmpose, projects/rtmpose, for mean,
standard deviation and the crop's margin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.detection.model_file import ModelFile
from aerodaas.analytics.people.crop import GREY, Region, square_around
from aerodaas.analytics.people.joints import POINTS
from aerodaas.geometry.frames import Box

__all__ = ["CropHead", "KeypointHead", "SimccHead", "keypoint_head"]

_TASK = "keypoints"
_NUMBERS = 3
"""Numbers per joint: u, v, confidence."""
_MARGIN = 1.25
"""Ratio of RTMPose's crop to the person's box."""
_MEAN = np.array([123.675, 116.28, 103.53], np.float32)
_DEVIATION = np.array([58.395, 57.12, 57.375], np.float32)
"""Of the training pictures' red, green and blue."""


class KeypointHead(Protocol):
    """Conventions of one kind of network."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of a crop in pixels."""
        ...

    @property
    def fill(self) -> int:
        """Grey level, 0 to 255, of a crop where it lies outside the image."""
        ...

    def region(self, box: Box) -> Region:
        """The part of the image around a person's box that is cropped; shaped as `size`."""
        ...

    def normalise(self, cuts: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Input values of crops (n, height, width, 3), RGB."""
        ...

    def decode(self, outputs: Sequence[NDArray[Any]]) -> NDArray[np.float32]:
        """Keypoints (n, 17, 3): u, v in pixels of the crop, and confidence, 0 to 1."""
        ...


@dataclass(frozen=True)
class CropHead:
    """Conventions of `tools.training pose`."""

    size: tuple[int, int]
    fill: int = GREY

    def region(self, box: Box) -> Region:
        """A square with a margin of a half."""
        return square_around(box)

    def normalise(self, cuts: NDArray[np.uint8]) -> NDArray[np.float32]:
        """0 to 1."""
        return np.asarray(cuts.astype(np.float32) / 255, np.float32)

    def decode(self, outputs: Sequence[NDArray[Any]]) -> NDArray[np.float32]:
        """As they are."""
        return np.array(outputs[0], np.float32)


@dataclass(frozen=True)
class SimccHead:
    """RTMPose's conventions."""

    size: tuple[int, int]
    split: int
    """Bins for each pixel."""
    fill: int = 0

    def region(self, box: Box) -> Region:
        """The box with a margin, widened or heightened to the crop's shape."""
        left, top, right, bottom = box
        shape = self.size[0] / self.size[1]
        wide = _MARGIN * max(right - left, shape * (bottom - top))
        high = wide / shape
        return (left + right - wide) / 2, (top + bottom - high) / 2, wide, high

    def normalise(self, cuts: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Standard deviations from the mean of the training pictures."""
        normal: NDArray[np.float32] = (cuts.astype(np.float32) - _MEAN) / _DEVIATION
        return normal

    def decode(self, outputs: Sequence[NDArray[Any]]) -> NDArray[np.float32]:
        """The maxima of both distributions; the confidence is the lower of the two."""
        columns, rows = (np.asarray(output, np.float32) for output in outputs)
        # A bin stands for a pixel's middle, which is half a pixel from its edge.
        places = [axis.argmax(axis=-1) / self.split + 0.5 for axis in (columns, rows)]
        sure = np.minimum(columns.max(axis=-1), rows.max(axis=-1)).clip(0, 1)
        return np.stack([*places, sure], axis=-1).astype(np.float32)


def keypoint_head(model: ModelFile) -> KeypointHead | None:
    """The conventions of a model's outputs; None for any other, or one that takes no crops.

    Crops are several at once, and numbers, not bytes.
    """
    if not model.batches or model.dtype is np.uint8:
        return None
    size = (model.size[1], model.size[0])
    if len(model.outputs) == 1:
        fits = model.metadata.get("task") == _TASK and model.size[0] == model.size[1]
        fits = fits and tuple(model.output_shape[1:]) == (POINTS, _NUMBERS)
        return CropHead(size) if fits else None
    shapes = [output.shape for output in model.trial]
    if [axis[:-1] for axis in shapes] != [(1, POINTS)] * 2:
        return None
    split, other = (axis[-1] / side for axis, side in zip(shapes, size, strict=True))
    return SimccHead(size, int(split)) if split == other >= 1 and split % 1 == 0 else None
