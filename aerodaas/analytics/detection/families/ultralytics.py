"""Ultralytics' anchor-free heads as exported without NMS: v5u, v8, 11 and 26, detect and pose.

One output of shape [batch, 4 + classes + keypoints, anchors]: box centre, width and height in
input pixels, class scores after the sigmoid, then keypoints (u, v and, with 3 numbers each, a
confidence). Source: ultralytics/nn/modules/head.py, `Detect` and `Pose`, and
ultralytics/engine/exporter.py for the metadata.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.detection.families.arrays import best_class, corners
from aerodaas.analytics.detection.families.base import (
    Candidates,
    Preprocessing,
    keep_finite,
    strides_for,
)
from aerodaas.analytics.detection.model_file import ModelFile

__all__ = ["UltralyticsDecoder", "keypoint_shape", "read_keypoints", "ultralytics"]

_AXES = 3
_BOX = 4
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
        keypoints = read_keypoints(rows[:, _BOX + self.classes :], self.keypoints)
        return keep_finite(Candidates(corners(rows[:, :_BOX]), scores, classes, keypoints, invalid))


def ultralytics(model: ModelFile) -> UltralyticsDecoder | None:
    """Recognise an output by its number of classes or, without class names, of anchors."""
    shape = model.output_shape
    if len(model.outputs) != 1 or len(shape) != _AXES:
        return None
    _, depth, anchors = shape
    keypoints = keypoint_shape(model)
    classes = depth - _BOX - (keypoints[0] * keypoints[1] if keypoints else 0)
    fits = classes == len(model.names) if model.names else strides_for(model.size, anchors)
    if not fits or classes < 1:
        return None
    return UltralyticsDecoder(classes, keypoints)


def keypoint_shape(model: ModelFile) -> tuple[int, int] | None:
    """Number of keypoints and of numbers for each (2 or 3), from the metadata of a pose model."""
    shape = model.literal("kpt_shape")
    pair = 2
    if not isinstance(shape, list | tuple) or len(shape) != pair or shape[1] not in (2, 3):
        return None
    return int(shape[0]), int(shape[1])


def read_keypoints(
    rows: NDArray[np.float32], shape: tuple[int, int] | None
) -> NDArray[np.float32] | None:
    """Reshape rows of flat keypoints; a missing confidence counts as 1.

    Args:
        rows: N rows.
        shape: Number of keypoints, and of numbers for each: 2 or 3; None without keypoints.

    Returns:
        Keypoints, N x K x 3, or None without.
    """
    if shape is None:
        return None
    points = rows.reshape(len(rows), *shape)
    full = 3
    if shape[1] == full:
        return points
    return np.concatenate([points, np.ones((*points.shape[:2], 1), np.float32)], axis=2)
