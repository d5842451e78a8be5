"""Non-maximum suppression, class by class."""

from __future__ import annotations

import cv2
import numpy as np

from aerodaas.analytics.detection.families.base import Candidates

__all__ = ["strongest", "suppress"]


def suppress(candidates: Candidates, iou: float) -> Candidates:
    """Keep, best first, boxes that overlap no better one of their class by more than `iou`."""
    if len(candidates) == 0:
        return candidates
    boxes = candidates.boxes.astype(np.float64)
    boxes[:, 2:] -= boxes[:, :2]
    # OpenCV's stubs require sequences, but its bindings accept arrays, which are much faster.
    kept = cv2.dnn.NMSBoxesBatched(
        boxes,  # type: ignore[arg-type]
        candidates.scores,  # type: ignore[arg-type]
        candidates.classes,  # type: ignore[arg-type]
        0.0,
        iou,
    )
    return candidates.take(np.asarray(kept, np.intp).reshape(-1))


def strongest(candidates: Candidates, count: int) -> Candidates:
    """Keep the `count` candidates of highest score, in no particular order."""
    if len(candidates) <= count:
        return candidates
    return candidates.take(np.argpartition(-candidates.scores, count)[:count])
