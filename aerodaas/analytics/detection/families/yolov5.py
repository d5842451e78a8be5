"""YOLOv5 and v7 heads with three anchor boxes per cell, decoded by the export.

One output of shape [batch, 3 x cells, 5 + classes]: box centre, width and height in input
pixels, objectness, class scores, all after the sigmoid. A box's score is objectness x class.
Source: ultralytics/yolov5, models/yolo.py, `Detect`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.detection.families.arrays import corners
from aerodaas.analytics.detection.families.base import (
    Candidates,
    Preprocessing,
    keep_finite,
    strides_for,
)
from aerodaas.analytics.detection.families.objectness import objectness_classes, pick
from aerodaas.analytics.detection.model_file import ModelFile

__all__ = ["YoloV5Decoder", "yolov5"]

_BOX = 4
_BOXES_A_CELL = 3
_PIXELS = Preprocessing()


@dataclass(frozen=True)
class YoloV5Decoder:
    """Decodes [boxes, 5 + classes]."""

    classes: int
    family: str = "YOLOv5"
    preprocessing: Preprocessing = _PIXELS
    overlapping: bool = True

    def decode(
        self, outputs: Sequence[NDArray[np.float32]], size: tuple[int, int], min_score: float
    ) -> Candidates:
        """Select the boxes with enough score, and convert them to corners.

        Args:
            outputs: One array, boxes x (5 + classes).
            size: Ignored.
            min_score: Least score of a box.
        """
        del size
        rows = outputs[0]
        kept, scores, classes, invalid = pick(rows, min_score)
        return keep_finite(Candidates(corners(rows[kept, :_BOX]), scores, classes, None, invalid))


def yolov5(model: ModelFile) -> YoloV5Decoder | None:
    """Recognise an output with three boxes per cell of the grid."""
    classes = objectness_classes(model)
    if classes is None:
        return None
    cells, rest = divmod(model.output_shape[1], _BOXES_A_CELL)
    if rest or strides_for(model.size, cells) is None:
        return None
    return YoloV5Decoder(classes)
