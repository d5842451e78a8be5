"""End-to-end exports, whose NMS is built in (`nms=True`) or not needed (YOLOv10 and 26).

One output of shape [batch, detections, 6 + keypoints], at most a few hundred detections: left,
top, right, bottom in input pixels, score, class, then keypoints; unused rows score zero. Source:
ultralytics/engine/exporter.py, `NMSModel`, and ultralytics/nn/modules/head.py, `postprocess`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.detection.coco import COCO_NAMES
from aerodaas.analytics.detection.families.arrays import listed
from aerodaas.analytics.detection.families.base import Candidates, Preprocessing, keep_finite
from aerodaas.analytics.detection.families.ultralytics import keypoint_shape, read_keypoints
from aerodaas.analytics.detection.model_file import ModelFile

__all__ = ["EndToEndDecoder", "end_to_end"]

_AXES = 3
_SCORE, _CLASS, _ROW = 4, 5, 6
_MOST_DETECTIONS = 3000
_PIXELS = Preprocessing()


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
        keypoints = read_keypoints(rows[kept, _ROW:], self.keypoints)
        return keep_finite(Candidates(rows[kept, :_SCORE], scores, classes, keypoints, invalid))


def end_to_end(model: ModelFile) -> EndToEndDecoder | None:
    """Recognise rows of six numbers, plus the keypoints declared in the metadata."""
    shape = model.output_shape
    keypoints = keypoint_shape(model)
    depth = _ROW + (keypoints[0] * keypoints[1] if keypoints else 0)
    if len(model.outputs) != 1 or len(shape) != _AXES or shape[2] != depth:
        return None
    if shape[1] > _MOST_DETECTIONS:
        return None
    return EndToEndDecoder(len(model.names or COCO_NAMES), keypoints)
