"""YOLO-NAS as exported without NMS: boxes [batch, cells, 4] and scores [batch, cells, classes].

Boxes are left, top, right, bottom in input pixels; scores are after the sigmoid. An export with
preprocessing takes bytes, one without takes 0 to 1. Source: Deci-AI/super-gradients,
training/models/detection_models/yolo_nas/dfl_heads.py, `NDFLHeads`, and
training/processing/processing.py, `default_yolo_nas_coco_processing_params`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.detection.families.arrays import best_class, boxes_and_scores
from aerodaas.analytics.detection.families.base import (
    Candidates,
    Preprocessing,
    keep_finite,
    strides_for,
)
from aerodaas.analytics.detection.model_file import ModelFile

__all__ = ["YoloNasDecoder", "yolo_nas"]

_OUTPUTS = 2
_PIXELS = Preprocessing()


@dataclass(frozen=True)
class YoloNasDecoder:
    """Decodes boxes [cells, 4] and scores [cells, classes]."""

    classes: int
    outputs: tuple[int, int]
    """Numbers of the outputs of boxes and of scores."""
    family: str = "YOLO-NAS"
    preprocessing: Preprocessing = _PIXELS
    overlapping: bool = True

    def decode(
        self, outputs: Sequence[NDArray[np.float32]], size: tuple[int, int], min_score: float
    ) -> Candidates:
        """Keep the cells with enough score.

        Args:
            outputs: Boxes (N, 4) in pixels and scores (N, classes), in the order of the model.
            size: Ignored.
            min_score: Least score of a cell.
        """
        del size
        boxes, scores = (outputs[number] for number in self.outputs)
        kept, best, classes, invalid = best_class(scores.T, min_score)
        return keep_finite(Candidates(boxes[kept], best, classes, None, invalid))


def yolo_nas(model: ModelFile) -> YoloNasDecoder | None:
    """Recognise boxes and scores in outputs of their own, one for each cell of the grid."""
    if len(model.outputs) != _OUTPUTS:
        return None
    shapes = [output.shape for output in model.trial]
    found = boxes_and_scores(shapes)
    if found is None or strides_for(model.size, shapes[found[0]][1]) is None:
        return None
    return YoloNasDecoder(shapes[found[1]][2], found)
