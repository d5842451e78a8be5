"""The plug-in protocol for a kind of model: how pixels go in and how boxes come out.

A family is a callable: given a `ModelFile`, it returns a decoder made for that file, or None if
the file is of another kind. For a model that no family here knows, write one and pass it::

    OnnxDetector("rtdetr.onnx", families=[rtdetr, *FAMILIES])
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
    """How a family wants its pixels: letterboxed, then scaled."""

    scale: float = 1 / 255
    """Factor from 0-255 to the network's range."""
    rgb: bool = True
    """Channel order red, green, blue; otherwise blue, green, red."""
    centred: bool = True
    """Padding on both sides; otherwise the picture lies in the top left corner."""
    fill: int = 114
    """Grey level of the padding, 0 to 255."""


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
    """Outputs that were dropped because they were not finite."""

    def __len__(self) -> int:
        """Count the candidates."""
        return len(self.scores)

    def take(self, index: NDArray[np.intp] | NDArray[np.bool_]) -> Candidates:
        """The candidates at `index`, in that order."""
        keypoints = None if self.keypoints is None else self.keypoints[index]
        return Candidates(
            self.boxes[index], self.scores[index], self.classes[index], keypoints, self.invalid
        )


class Decoder(Protocol):
    """Turns the raw outputs of one file into candidates; sent to the actor by value."""

    @property
    def family(self) -> str:
        """Name of the family, for the log."""
        ...

    @property
    def classes(self) -> int:
        """Number of classes that the model tells apart."""
        ...

    @property
    def preprocessing(self) -> Preprocessing:
        """How the pixels go in."""
        ...

    @property
    def overlapping(self) -> bool:
        """Whether the candidates still need non-maximum suppression."""
        ...

    def decode(
        self, outputs: Sequence[NDArray[np.float32]], size: tuple[int, int], min_score: float
    ) -> Candidates:
        """Decode the outputs for one picture, the batch axis already taken off.

        `size` is the height and width of the network's input in pixels.
        """
        ...


class ModelFamily(Protocol):
    """Recognises the files of one kind, by what is in them."""

    def __call__(self, model: ModelFile, /) -> Decoder | None:
        """Return a decoder for `model`, or None if it is of another kind."""
        ...


_STRIDES = ((8, 16, 32), (8, 16, 32, 64), (4, 8, 16, 32), (16, 32))


def strides_for(size: tuple[int, int], count: int) -> tuple[int, ...] | None:
    """The strides whose feature maps have `count` cells in all; None if there are none."""
    return next((s for s in _STRIDES if _anchor_count(size, s) == count), None)


def keep_finite(candidates: Candidates) -> Candidates:
    """Drop the candidates with a number that is not finite, and count them."""
    finite = np.isfinite(candidates.boxes).all(axis=1) & np.isfinite(candidates.scores)
    if candidates.keypoints is not None:
        finite &= np.isfinite(candidates.keypoints).all(axis=(1, 2))
    if finite.all():
        return candidates
    kept = candidates.take(finite)
    invalid = candidates.invalid + int(np.count_nonzero(~finite))
    return Candidates(kept.boxes, kept.scores, kept.classes, kept.keypoints, invalid)


def _anchor_count(size: tuple[int, int], strides: Sequence[int]) -> int:
    """Cells of all feature maps for an input of `size` (height, width) pixels."""
    height, width = size
    return sum(-(-height // stride) * -(-width // stride) for stride in strides)
