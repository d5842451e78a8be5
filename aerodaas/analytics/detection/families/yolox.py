"""YOLOX heads: one box per cell, decoded from grid and stride unless the export has done it.

One output of shape [batch, cells, 5 + classes]: offsets from the cell in units of the stride,
logarithms of width and height over the stride, objectness and class scores after the sigmoid.
The input is BGR, 0 to 255, padded to the right and below. Source: Megvii-BaseDetection/YOLOX,
yolox/utils/demo_utils.py, `demo_postprocess`, and yolox/data/data_augment.py, `preproc`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

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

__all__ = ["YoloxDecoder", "yolox"]

_BOX = 4
_LARGEST_OFFSET = 8.0
_PIXELS = Preprocessing(scale=1.0, rgb=False, centred=False)


@dataclass(frozen=True)
class YoloxDecoder:
    """Decodes [cells, 5 + classes]."""

    classes: int
    strides: tuple[int, ...] = (8, 16, 32)
    decoded: bool = False
    """Whether the export has applied grid and stride (`--decode_in_inference`)."""
    family: str = "YOLOX"
    preprocessing: Preprocessing = _PIXELS
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
        kept, scores, classes, invalid = pick(rows, min_score)
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
    classes = objectness_classes(model)
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
