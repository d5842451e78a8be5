"""Exports with NMS that give count, boxes, scores and classes in outputs of their own.

Count [batch, 1], boxes [batch, detections, 4] as left, top, right, bottom in input pixels, scores
and classes [batch, detections], in this order; what follows the first `count` detections is
padding. YOLO-NAS is exported so (`output_predictions_format=BATCH`), and what follows TensorRT's
EfficientNMS. Sources: Deci-AI/super-gradients, documentation/source/models_export.md;
NVIDIA/TensorRT, plugin/efficientNMSPlugin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.detection.coco import COCO_NAMES
from aerodaas.analytics.detection.families.arrays import listed
from aerodaas.analytics.detection.families.base import Candidates, Preprocessing, keep_finite
from aerodaas.analytics.detection.model_file import ModelFile

__all__ = ["NmsOutputsDecoder", "nms_outputs"]

_OUTPUTS, _BOX = 4, 4
_PIXELS = Preprocessing()


@dataclass(frozen=True)
class NmsOutputsDecoder:
    """Decodes count [1], boxes [detections, 4], scores and classes [detections]."""

    classes: int
    family: str = "NMS with four outputs"
    preprocessing: Preprocessing = _PIXELS
    overlapping: bool = False

    def decode(
        self, outputs: Sequence[NDArray[np.float32]], size: tuple[int, int], min_score: float
    ) -> Candidates:
        """Keep the detections with enough score and a valid class.

        Args:
            outputs: Number of detections, boxes (N, 4), scores (N,) and class numbers (N,).
            size: Ignored.
            min_score: Least score of a detection.
        """
        del size
        count, boxes, scores, numbers = outputs
        # The first ones, so that their numbers hold for the boxes, too.
        given = np.arange(len(scores)) < count.reshape(-1)[0]
        kept, best, classes, invalid = listed(
            scores[given], numbers[given], self.classes, min_score
        )
        return keep_finite(Candidates(boxes[kept], best, classes, None, invalid))


def nms_outputs(model: ModelFile) -> NmsOutputsDecoder | None:
    """Recognise four outputs of these shapes."""
    if len(model.outputs) != _OUTPUTS:
        return None
    count, boxes, scores, classes = (output.shape for output in model.trial)
    most = boxes[1] if boxes[2:] == (_BOX,) else None
    if count not in ((1, 1), (1,)) or scores != (1, most) or classes != (1, most):
        return None
    return NmsOutputsDecoder(len(model.names or COCO_NAMES))
