"""Vests, persons, cars and towers in pictures, by the shipped network and ONNX Runtime."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import onnxruntime
from numpy.typing import NDArray

MODELS = Path(__file__).resolve().parents[2] / "aerodaas/analytics/models"
NAMES = ("vest", "person", "car", "tower")
ROWS, COLUMNS, STRIDE = 256, 384, 32
OVERLAP = 0.45


class Box(NamedTuple):
    """One thing that was found; edges in pixels."""

    score: float
    left: float
    top: float
    right: float
    bottom: float

    @property
    def u(self) -> float:
        """Its middle from the left."""
        return (self.left + self.right) / 2

    @property
    def v(self) -> float:
        """Its middle from the top."""
        return (self.top + self.bottom) / 2

    def holds(self, other: Box) -> bool:
        """Whether the middle of another lies in it."""
        return self.left < other.u < self.right and self.top < other.v < self.bottom


def session(name: str) -> Any:  # noqa: ANN401 - ONNX Runtime has no types
    """Load a network, to run on one core."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    return onnxruntime.InferenceSession(MODELS / name, options)


class BoxDetector:
    """The network, with what goes before and after it."""

    def __init__(self, score: float = 0.3) -> None:
        self.network = session("detector.onnx")
        self.score = score

    def find(self, image: NDArray[Any], *, rgb: bool = False) -> dict[str, list[Box]]:
        """Find things in a BGR or RGB picture: by name, the best first."""
        height, width = image.shape[:2]
        ratio = min(ROWS / height, COLUMNS / width)
        inner = cv2.resize(image, (round(width * ratio), round(height * ratio)))
        rows, columns = (-(-side // STRIDE) * STRIDE for side in inner.shape[:2])
        top, left = (rows - inner.shape[0]) // 2, (columns - inner.shape[1]) // 2
        padded = np.full((rows, columns, 3), 114, np.uint8)
        padded[top : top + inner.shape[0], left : left + inner.shape[1]] = inner
        padded = padded if rgb else padded[:, :, ::-1]
        pixels = padded.transpose(2, 0, 1)[None].astype(np.float32) / 255
        (output,) = self.network.run(None, {"images": pixels})
        cells = output[0].T
        corners = np.hstack([cells[:, :2] - cells[:, 2:4] / 2, cells[:, :2] + cells[:, 2:4] / 2])
        corners = (corners - [left, top, left, top]) / ratio
        corners = corners.clip(0, [width, height, width, height])
        sizes = np.hstack([corners[:, :2], corners[:, 2:] - corners[:, :2]])
        found = {}
        for number, name in enumerate(NAMES):
            scores = cells[:, 4 + number]
            kept = cv2.dnn.NMSBoxes(sizes.tolist(), scores.tolist(), self.score, OVERLAP)
            found[name] = [Box(float(scores[one]), *map(float, corners[one])) for one in kept]
        return found
