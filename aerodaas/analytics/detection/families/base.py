"""Plug-in protocol of a model family: preprocessing of pixels and decoding of boxes.

A family is a callable: given a `ModelFile`, it returns a decoder for that file, or None if the
file belongs to another family. For an unsupported model, write a family and pass it::

    from aerodaas.analytics.detection.families import FAMILIES

    OnnxDetector("mine.onnx", families=[my_family, *FAMILIES])
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.detection.model_file import ModelFile

__all__ = [
    "Candidates",
    "Decoder",
    "ModelFamily",
    "Preprocessing",
    "keep_finite",
    "strides_for",
]


@dataclass(frozen=True)
class Preprocessing:
    """Preprocessing of a family's input: letterboxing, then scaling."""

    scale: float = 1 / 255
    """Factor from 0-255 to the network's range."""
    rgb: bool = True
    """Channel order red, green, blue; otherwise blue, green, red."""
    centred: bool = True
    """Padding on both sides; otherwise the image lies in the top left corner."""
    fill: int = 114
    """Grey level of the padding, 0 to 255."""
    stretched: bool = False
    """The image fills the input, whatever its aspect ratio; otherwise it is padded."""


@dataclass(frozen=True)
class Candidates:
    """Boxes above the score threshold, in pixels of the network's input."""

    boxes: NDArray[np.float32]
    """N x 4: left, top, right, bottom."""
    scores: NDArray[np.float32]
    """N, 0 to 1."""
    classes: NDArray[np.int32]
    """N class numbers."""
    keypoints: NDArray[np.float32] | None = None
    """N x K x 3: u, v, confidence."""
    invalid: int = 0
    """Number of outputs dropped because they were not finite."""

    def __len__(self) -> int:
        """Count the candidates."""
        return len(self.scores)

    def select(self, index: NDArray[np.intp] | NDArray[np.bool_]) -> Candidates:
        """The candidates at `index`, in that order."""
        keypoints = None if self.keypoints is None else self.keypoints[index]
        return Candidates(
            self.boxes[index], self.scores[index], self.classes[index], keypoints, self.invalid
        )


class Decoder(Protocol):
    """Converts the raw outputs of one model to candidates; copied to where it runs."""

    @property
    def family(self) -> str:
        """Name of the family, which `aerodaas models check` tells."""
        ...

    @property
    def classes(self) -> int:
        """Number of classes of the model."""
        ...

    @property
    def preprocessing(self) -> Preprocessing:
        """Preprocessing of the input."""
        ...

    @property
    def overlapping(self) -> bool:
        """Whether the candidates still need non-maximum suppression."""
        ...

    def decode(
        self, outputs: Sequence[NDArray[np.float32]], size: tuple[int, int], min_score: float
    ) -> Candidates:
        """Decode the outputs for one image, without the batch axis.

        Args:
            outputs: Outputs of the network for the image.
            size: Height and width of the network's input in pixels.
            min_score: Least score of a box that is kept; minus infinity in a trial run.

        Returns:
            The boxes in pixels of the network's input.
        """
        ...


class ModelFamily(Protocol):
    """Recognises the files of one family by their content."""

    def __call__(self, model: ModelFile, /) -> Decoder | None:
        """Return a decoder for `model`, or None if it belongs to another family."""
        ...


_STRIDES = ((8, 16, 32), (8, 16, 32, 64), (4, 8, 16, 32), (16, 32))


def strides_for(size: tuple[int, int], count: int) -> tuple[int, ...] | None:
    """Strides whose feature maps have a number of cells in total.

    Args:
        size: Height and width of the network's input in pixels.
        count: Number of cells.

    Returns:
        The strides in pixels, or None if there are none.
    """
    return next((s for s in _STRIDES if _anchor_count(size, s) == count), None)


def keep_finite(candidates: Candidates) -> Candidates:
    """Drop and count the candidates with a number that is not finite."""
    finite = np.isfinite(candidates.boxes).all(axis=1) & np.isfinite(candidates.scores)
    if candidates.keypoints is not None:
        finite &= np.isfinite(candidates.keypoints).all(axis=(1, 2))
    if finite.all():
        return candidates
    kept = candidates.select(finite)
    invalid = candidates.invalid + int(np.count_nonzero(~finite))
    return Candidates(kept.boxes, kept.scores, kept.classes, kept.keypoints, invalid)


def _anchor_count(size: tuple[int, int], strides: Sequence[int]) -> int:
    """Number of cells of all feature maps for an input of `size` (height, width) pixels."""
    height, width = size
    return sum(-(-height // stride) * -(-width // stride) for stride in strides)
