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
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import onnxruntime as ort
from numpy.typing import NDArray

from aerodaas.analytics.detection.model_file import ModelFile, read_model
from aerodaas.analytics.detection.providers import open_session
from aerodaas.analytics.models import POSE
from aerodaas.analytics.people.joints import (
    GREY,
    MIRRORED,
    POINTS,
    Region,
    cut_region,
    square_around,
)
from aerodaas.errors import ModelError
from aerodaas.geometry.frames import Box

__all__ = ["CropHead", "KeypointHead", "KeypointModel", "SimccHead", "keypoint_head"]

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


_ASTRAY = 0.1
"""Distance of the two estimates of a joint, in sides of the crop, from which one is doubtful."""


class KeypointModel:
    """A keypoint network on crops around people: as `tools.training pose` exports it, or RTMPose.

    The network runs on each crop twice, the second time mirrored. A real arm is found in both; a
    spurious one, such as a window behind a shoulder, rarely is.
    """

    def __init__(
        self,
        path: str | Path = POSE,
        *,
        providers: Sequence[str] | None = None,
        threads: int | None = None,
    ) -> None:
        """Read the file, or a fetched model by its name; it is copied to where it runs.

        Raises:
            ModelError: If it is missing, or is no such network.
            UnknownIdError: If no model has this name.
        """
        model = read_model(path)
        head = keypoint_head(model)
        if head is None:
            raise model.refusal(
                "finds no keypoints in cuts around people",
                "train one with `python -m tools.training pose`, or take an RTMPose; a YOLO pose "
                "model is for OnnxDetector",
            )
        self.path = str(path)
        self.head = head
        """How the network crops, normalises and gives its joints."""
        self._content, self._input, self._dtype = model.content, model.input.name, model.dtype
        self._providers, self._threads = providers, threads
        self._session: ort.InferenceSession | None = None

    def open(self) -> None:
        """Create the session and warm it up, so that the mission's first frame is not slow."""
        self._session = open_session(self._content, self.path, self._providers, self._threads)
        width, height = self.head.size
        self._run(np.zeros((1, height, width, 3), np.uint8))

    def close(self) -> None:
        """Release the session."""
        self._session = None

    def find(self, image: NDArray[np.uint8], boxes: Sequence[Box]) -> NDArray[np.float32]:
        """Find the keypoints of the person in each of some boxes, by one run of the network.

        Args:
            image: Picture, height x width x 3, BGR.
            boxes: Boxes of people, in pixels of `image`.

        Returns:
            Keypoints (n, 17, 3): u and v in pixels of `image`, and confidence.

        Raises:
            ModelError: Before `open`.
        """
        head = self.head
        regions = [head.region(box) for box in boxes]
        cuts = np.stack([cut_region(image, one, head.size, head.fill) for one in regions])
        straight, mirrored = np.split(self._run(np.concatenate([cuts, cuts[:, :, ::-1]])), 2)
        found = self._agreed(straight, mirrored)
        for points, (left, top, wide, _) in zip(found, regions, strict=True):
            points[:, :2] = points[:, :2] * (wide / head.size[0]) + (left, top)
        return found

    def _agreed(
        self, straight: NDArray[np.float32], mirrored: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Merge the keypoints of both runs; confidence falls with the distance between them."""
        other = mirrored[:, MIRRORED]
        other[..., 0] = self.head.size[0] - other[..., 0]
        away = np.linalg.norm(straight[..., :2] - other[..., :2], axis=-1)
        apart = away / max(self.head.size)
        agreed = (straight + other) / 2
        surer = np.where(straight[..., 2:] >= other[..., 2:], straight, other)
        places = np.where((apart < _ASTRAY)[..., None], agreed, surer)
        places[..., 2] = agreed[..., 2] * np.exp(-0.5 * np.square(apart / _ASTRAY))
        return np.asarray(places, np.float32)

    def _run(self, cuts: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Keypoints in crops (n, height, width, 3), BGR."""
        if self._session is None:
            raise ModelError(f"{self.path}: call open() before the first frame")
        pixels = self.head.normalise(cuts[..., ::-1]).transpose(0, 3, 1, 2)
        given = np.ascontiguousarray(pixels, self._dtype)
        outputs = self._session.run(None, {self._input: given})
        return self.head.decode([np.asarray(output) for output in outputs])
