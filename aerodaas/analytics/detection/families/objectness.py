"""Heads with an objectness beside the class scores: YOLOv5 and v7, and YOLOX.

A box's score is objectness x class, both after the sigmoid. YOLOv5 and v7 have three anchor boxes
per cell, decoded by the export: one output of shape [batch, 3 x cells, 5 + classes] with box
centre, width and height in input pixels. Source: ultralytics/yolov5, models/yolo.py, `Detect`.

YOLOX has one box per cell, decoded from grid and stride unless the export has done it: one output
of shape [batch, cells, 5 + classes] with offsets from the cell in units of the stride, and
logarithms of width and height over the stride. The input is BGR, 0 to 255, padded to the right and
below. Source: Megvii-BaseDetection/YOLOX, yolox/utils/demo_utils.py, `demo_postprocess`, and
yolox/data/data_augment.py, `preproc`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

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

__all__ = ["YoloV5Decoder", "YoloxDecoder", "yolov5", "yolox"]

_AXES, _BOX = 3, 4
_OBJECTNESS, _FIRST_CLASS = 4, 5
_BOXES_A_CELL = 3
_LARGEST_OFFSET = 8.0
_PIXELS = Preprocessing()
_BLUE_FIRST = Preprocessing(scale=1.0, rgb=False, centred=False)


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
        kept, scores, classes, invalid = _pick(rows, min_score)
        return keep_finite(Candidates(corners(rows[kept, :_BOX]), scores, classes, None, invalid))


def yolov5(model: ModelFile) -> YoloV5Decoder | None:
    """Recognise an output with three boxes per cell of the grid."""
    classes = _classes(model)
    if classes is None:
        return None
    cells, rest = divmod(model.output_shape[1], _BOXES_A_CELL)
    if rest or strides_for(model.size, cells) is None:
        return None
    return YoloV5Decoder(classes)


@dataclass(frozen=True)
class YoloxDecoder:
    """Decodes [cells, 5 + classes]."""

    classes: int
    strides: tuple[int, ...] = (8, 16, 32)
    decoded: bool = False
    """Whether the export has applied grid and stride (`--decode_in_inference`)."""
    family: str = "YOLOX"
    preprocessing: Preprocessing = _BLUE_FIRST
    overlapping: bool = True

    def decode(
        self, outputs: Sequence[NDArray[np.float32]], size: tuple[int, int], min_score: float
    ) -> Candidates:
        """Decode only the cells with enough score.

        Args:
            outputs: One array, cells x (5 + classes).
            size: Height and width of the network's input in pixels.
            min_score: Least score of a cell.
        """
        rows = outputs[0]
        kept, scores, classes, invalid = _pick(rows, min_score)
        boxes = rows[kept, :_BOX]
        if not self.decoded:
            cells = _cells(size, self.strides)[kept]
            stride = cells[:, 2:]
            with np.errstate(over="ignore", invalid="ignore"):
                centres = (boxes[:, :2] + cells[:, :2]) * stride
                boxes = np.hstack([centres, np.exp(boxes[:, 2:]) * stride])
        return keep_finite(Candidates(corners(boxes), scores, classes, None, invalid))


def yolox(model: ModelFile) -> YoloxDecoder | None:
    """Recognise an output with one box per cell of the grid.

    The trial image shows whether the export has decoded the boxes: centres in pixels lie some
    hundreds of pixels apart, while offsets in units of the stride stay near zero.
    """
    classes = _classes(model)
    if classes is None:
        return None
    strides = strides_for(model.size, model.output_shape[1])
    if strides is None:
        return None
    offsets = model.trial[0][0, :, :2]
    return YoloxDecoder(classes, strides, decoded=bool(np.median(offsets) > _LARGEST_OFFSET))


@lru_cache(maxsize=8)
def _cells(size: tuple[int, int], strides: tuple[int, ...]) -> NDArray[np.float32]:
    """Column, row and stride of every cell, cells x 3, in the order of the output's rows."""
    height, width = size
    maps = []
    for stride in strides:
        rows, columns = np.mgrid[: -(-height // stride), : -(-width // stride)]
        cells = np.stack([columns, rows, np.full_like(rows, stride)], axis=-1)
        maps.append(cells.reshape(-1, 3))
    table: NDArray[np.float32] = np.concatenate(maps).astype(np.float32)
    return table


def _pick(
    rows: NDArray[np.float32], min_score: float
) -> tuple[NDArray[np.intp], NDArray[np.float32], NDArray[np.int32], int]:
    """Indices, scores and classes of the boxes with enough score, and the number of NaN scores."""
    # No class score exceeds 1, so the objectness alone rules out most boxes.
    objectness = rows[:, _OBJECTNESS]
    invalid = int(np.count_nonzero(np.isnan(objectness)))
    likely = np.flatnonzero(objectness >= min_score)
    scores = (rows[likely, _FIRST_CLASS:] * objectness[likely, None]).T
    kept, best, classes, broken = best_class(scores, min_score)
    return likely[kept], best, classes, invalid + broken


def _classes(model: ModelFile) -> int | None:
    """Number of classes if the output's shape can be [1, boxes, 5 + classes], else None."""
    shape = model.output_shape
    if len(model.outputs) != 1 or len(shape) != _AXES or shape[2] <= _FIRST_CLASS:
        return None
    classes = shape[2] - _FIRST_CLASS
    if model.names is not None and len(model.names) != classes:
        return None
    return classes
