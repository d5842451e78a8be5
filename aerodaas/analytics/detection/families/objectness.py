"""Helpers for heads with an objectness beside the class scores: YOLOv5, v7, YOLOX."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.detection.families.arrays import best_class
from aerodaas.analytics.detection.model_file import ModelFile

__all__ = ["objectness_classes", "pick"]

_AXES = 3
_OBJECTNESS, _FIRST_CLASS = 4, 5


def pick(
    rows: NDArray[np.float32], min_score: float
) -> tuple[NDArray[np.intp], NDArray[np.float32], NDArray[np.int32], int]:
    """Find the boxes whose score, objectness x class score, is enough.

    No class score exceeds 1, so the objectness alone rules out most boxes.

    Args:
        rows: Boxes x (5 + classes).
        min_score: Least score of a box that is kept.

    Returns:
        Indices of the boxes that are kept, their scores and classes, and the number of NaN scores.
    """
    objectness = rows[:, _OBJECTNESS]
    invalid = int(np.count_nonzero(np.isnan(objectness)))
    likely = np.flatnonzero(objectness >= min_score)
    scores = (rows[likely, _FIRST_CLASS:] * objectness[likely, None]).T
    kept, best, classes, broken = best_class(scores, min_score)
    return likely[kept], best, classes, invalid + broken


def objectness_classes(model: ModelFile) -> int | None:
    """Number of classes if the output's shape can be [1, boxes, 5 + classes], else None."""
    shape = model.output_shape
    if len(model.outputs) != 1 or len(shape) != _AXES or shape[2] <= _FIRST_CLASS:
        return None
    classes = shape[2] - _FIRST_CLASS
    if model.names is not None and len(model.names) != classes:
        return None
    return classes
