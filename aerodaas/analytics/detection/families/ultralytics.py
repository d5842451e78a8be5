"""Ultralytics' anchor-free heads, detect and pose: v5u, v8, 11 and 26 without NMS, and end to end.

Without NMS there is one output of shape [batch, 4 + classes + keypoints, anchors]: box centre,
width and height in input pixels, class scores after the sigmoid, then keypoints (u, v and, with 3
numbers each, a confidence). With NMS built in (`nms=True`) or not needed (YOLOv10 and 26), it has
the shape [batch, detections, 6 + keypoints], at most a few hundred detections: left, top, right,
bottom in input pixels, score, class, then keypoints; unused rows score zero. Source:
ultralytics/nn/modules/head.py, `Detect`, `Pose` and `postprocess`, and
ultralytics/engine/exporter.py, `NMSModel` and the metadata.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.detection.coco import COCO_NAMES
from aerodaas.analytics.detection.families.arrays import best_class, corners, listed
from aerodaas.analytics.detection.families.base import (
    Candidates,
    Preprocessing,
    keep_finite,
    strides_for,
)
from aerodaas.analytics.detection.model_file import ModelFile

__all__ = ["EndToEndDecoder", "UltralyticsDecoder", "end_to_end", "ultralytics"]

_AXES = 3
_BOX = 4
_SCORE, _CLASS, _ROW = 4, 5, 6
_MOST_DETECTIONS = 3000
_PIXELS = Preprocessing()


@dataclass(frozen=True)
class UltralyticsDecoder:
    """Decodes [4 + classes + keypoints, anchors]."""

    classes: int
    keypoints: tuple[int, int] | None = None
    """Number of keypoints and of numbers for each."""
    family: str = "Ultralytics"
    preprocessing: Preprocessing = _PIXELS
    overlapping: bool = True

    def decode(
        self, outputs: Sequence[NDArray[np.float32]], size: tuple[int, int], min_score: float
    ) -> Candidates:
        """Decode only the anchors with enough score.

        Args:
            outputs: One array, (4 + classes + keypoints) x N anchors.
            size: Ignored.
            min_score: Least score of an anchor.
        """
        del size
        raw = outputs[0]
        kept, scores, classes, invalid = best_class(raw[_BOX : _BOX + self.classes], min_score)
        rows = raw[:, kept].T
        keypoints = _read_keypoints(rows[:, _BOX + self.classes :], self.keypoints)
        return keep_finite(Candidates(corners(rows[:, :_BOX]), scores, classes, keypoints, invalid))


def ultralytics(model: ModelFile) -> UltralyticsDecoder | None:
    """Recognise an output by its number of classes or, without class names, of anchors."""
    shape = model.output_shape
    if len(model.outputs) != 1 or len(shape) != _AXES:
        return None
    _, depth, anchors = shape
    keypoints = _keypoint_shape(model)
    classes = depth - _BOX - (keypoints[0] * keypoints[1] if keypoints else 0)
    fits = classes == len(model.names) if model.names else strides_for(model.size, anchors)
    if not fits or classes < 1:
        return None
    return UltralyticsDecoder(classes, keypoints)


@dataclass(frozen=True)
class EndToEndDecoder:
    """Decodes [detections, 6 + keypoints]."""

    classes: int
    keypoints: tuple[int, int] | None = None
    family: str = "Ultralytics end to end"
    preprocessing: Preprocessing = _PIXELS
    overlapping: bool = False

    def decode(
        self, outputs: Sequence[NDArray[np.float32]], size: tuple[int, int], min_score: float
    ) -> Candidates:
        """Keep the rows with enough score and a valid class.

        Args:
            outputs: One array, N rows of box, score, class and keypoints.
            size: Ignored.
            min_score: Least score of a row.
        """
        del size
        rows = outputs[0]
        kept, scores, classes, invalid = listed(
            rows[:, _SCORE], rows[:, _CLASS], self.classes, min_score
        )
        keypoints = _read_keypoints(rows[kept, _ROW:], self.keypoints)
        return keep_finite(Candidates(rows[kept, :_SCORE], scores, classes, keypoints, invalid))


def end_to_end(model: ModelFile) -> EndToEndDecoder | None:
    """Recognise rows of six numbers, plus the keypoints declared in the metadata."""
    shape = model.output_shape
    keypoints = _keypoint_shape(model)
    depth = _ROW + (keypoints[0] * keypoints[1] if keypoints else 0)
    if len(model.outputs) != 1 or len(shape) != _AXES or shape[2] != depth:
        return None
    if shape[1] > _MOST_DETECTIONS:
        return None
    return EndToEndDecoder(len(model.names or COCO_NAMES), keypoints)


def _keypoint_shape(model: ModelFile) -> tuple[int, int] | None:
    """Number of keypoints and of numbers for each (2 or 3), from the metadata of a pose model."""
    shape = model.literal("kpt_shape")
    pair = 2
    if not isinstance(shape, list | tuple) or len(shape) != pair or shape[1] not in (2, 3):
        return None
    return int(shape[0]), int(shape[1])


def _read_keypoints(
    rows: NDArray[np.float32], shape: tuple[int, int] | None
) -> NDArray[np.float32] | None:
    """Keypoints of N rows, N x K x 3; a missing confidence counts as 1."""
    if shape is None:
        return None
    points = rows.reshape(len(rows), *shape)
    full = 3
    if shape[1] == full:
        return points
    return np.concatenate([points, np.ones((*points.shape[:2], 1), np.float32)], axis=2)
