"""RT-DETR: a transformer's list of boxes, one for each query, which needs no suppression.

Boxes are centre, width and height as fractions of the input, to which the image is stretched. The
exports differ in the rest: Ultralytics' has one output, [batch, queries, 6] with score and class
after the box, or in earlier versions [batch, queries, 4 + classes] with scores after the sigmoid;
Hugging Face's has two, boxes [batch, queries, 4] and logits [batch, queries, classes]. Sources:
ultralytics/nn/modules/head.py, `RTDETRDecoder`, ultralytics/models/rtdetr/predict.py, and
transformers, models/rt_detr/modeling_rt_detr.py, `RTDetrForObjectDetection`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.detection.coco import COCO_NAMES
from aerodaas.analytics.detection.families.arrays import best_class, corners, listed
from aerodaas.analytics.detection.families.base import Candidates, Preprocessing, keep_finite
from aerodaas.analytics.detection.model_file import ModelFile

__all__ = ["RtDetrDecoder", "rtdetr"]

_AXES = 3
_BOX, _SCORE, _CLASS, _ROW = 4, 4, 5, 6
_MOST_QUERIES = 1000
_SURE = 0.5
_PIXELS = Preprocessing(stretched=True)


@dataclass(frozen=True)
class RtDetrDecoder:
    """Decodes [queries, 4 + classes], [queries, 6], or boxes and scores in outputs of their own."""

    classes: int
    separate: tuple[int, int] | None = None
    """Numbers of the outputs of boxes and of scores; None if one output holds both."""
    logits: bool = False
    """Whether the scores are before the sigmoid."""
    ranked: bool = False
    """Whether the one output holds the best score and its class, instead of all scores."""
    family: str = "RT-DETR"
    preprocessing: Preprocessing = _PIXELS
    overlapping: bool = False

    def decode(
        self, outputs: Sequence[NDArray[np.float32]], size: tuple[int, int], min_score: float
    ) -> Candidates:
        """Keep the queries with enough score, their boxes scaled to pixels.

        Args:
            outputs: Boxes as fractions of the input, with their scores or with score and class.
            size: Height and width of the network's input in pixels.
            min_score: Least score of a query.
        """
        if self.ranked:
            boxes = outputs[0]
            found = listed(boxes[:, _SCORE], boxes[:, _CLASS], self.classes, min_score)
        else:
            if self.separate is None:
                boxes, scores = outputs[0][:, :_BOX], outputs[0][:, _BOX:]
            else:
                boxes, scores = (outputs[number] for number in self.separate)
            found = best_class((_sigmoid(scores) if self.logits else scores).T, min_score)
        kept, best, classes, invalid = found
        height, width = size
        pixels = corners(boxes[kept, :_BOX]) * np.array([width, height, width, height], np.float32)
        return keep_finite(Candidates(pixels, best, classes, None, invalid))


def rtdetr(model: ModelFile) -> RtDetrDecoder | None:
    """Recognise at most a thousand boxes, all of which the trial picture shows to be fractions."""
    if not _may_be(model):
        return None
    shapes = [output.shape for output in model.trial]
    separate = _boxes_and_scores(shapes)
    if separate is not None:
        boxes, scores = (model.trial[number][0] for number in separate)
    elif len(shapes) == 1 and len(shapes[0]) == _AXES:
        boxes, scores = np.split(model.trial[0][0], [_BOX], axis=1)
    else:
        return None
    fractions = bool(((boxes >= 0) & (boxes <= 1)).all() and boxes.any())
    if not 1 <= len(boxes) <= _MOST_QUERIES or not fractions:
        return None
    if separate is not None:
        # One number is enough: hundreds of logits do not all lie between 0 and 1.
        logits = bool(((scores < 0) | (scores > 1)).any())
        if logits and _has_no_object(scores):
            raise model.refusal(
                "gives a softmax over its classes and a last column 'no object', as DETR and YOLOS "
                "do",
                "such a network also wants its input normalised by ImageNet's mean and deviation; "
                "choose an RT-DETR, or pass a ModelFamily of your own in families=",
            )
        return RtDetrDecoder(scores.shape[1], separate, logits)
    names = model.names or COCO_NAMES
    if scores.shape[1] == _ROW - _BOX and (scores[:, 1] % 1 == 0).all():
        return RtDetrDecoder(len(names), ranked=True)
    return RtDetrDecoder(len(names)) if scores.shape[1] == len(names) else None


def _has_no_object(logits: NDArray[np.float32]) -> bool:
    """Whether most queries of an empty picture are surely of the last class, by a softmax.

    Carion et al., "End-to-End Object Detection with Transformers", ECCV 2020, section 3.1.
    """
    odds = np.exp(logits - logits.max(axis=1, keepdims=True))
    return bool(np.median(odds[:, -1] / odds.sum(axis=1)) > _SURE)


def _may_be(model: ModelFile) -> bool:
    """Whether the declared outputs can be a list of boxes, so that a trial is worth its time."""
    shapes = [output.shape for output in model.outputs]
    queries = {shape[1] for shape in shapes if len(shape) == _AXES}
    few = all(count is None or 1 <= count <= _MOST_QUERIES for count in queries)
    return len(shapes) in (1, 2) and len(queries) == 1 and few


def _boxes_and_scores(shapes: Sequence[tuple[int, ...]]) -> tuple[int, int] | None:
    """Find which of two outputs is boxes [batch, n, 4] and which scores [batch, n, classes].

    Where there are four classes, the boxes come first. None for any other shapes.
    """
    pair = 2
    if len(shapes) != pair or any(len(shape) != _AXES for shape in shapes):
        return None
    if shapes[0][:2] != shapes[1][:2] or not all(shape[2] for shape in shapes):
        return None
    found = next((number for number, shape in enumerate(shapes) if shape[2] == _BOX), None)
    return None if found is None else (found, 1 - found)


def _sigmoid(logits: NDArray[np.float32]) -> NDArray[np.float32]:
    """Logistic function, without overflow."""
    return np.asarray(0.5 * (1 + np.tanh(0.5 * logits)), np.float32)
