"""Suppression of further boxes of one object: by overlap within a class, and around one another."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from aerodaas.analytics.detection.families.base import Candidates
from aerodaas.messages.detections import Detection

__all__ = ["one_for_each", "strongest", "suppress"]


def suppress(candidates: Candidates, iou: float) -> Candidates:
    """Keep, best first, boxes that overlap no better one of their class too much.

    Args:
        candidates: Boxes of one image.
        iou: Overlap, intersection over union, above which only the better one is kept.
    """
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
    return candidates.select(np.asarray(kept, np.intp).reshape(-1))


def strongest(candidates: Candidates, count: int) -> Candidates:
    """Keep the `count` candidates of highest score, in no particular order.

    Args:
        candidates: Boxes of one image.
        count: Largest number to keep.
    """
    if len(candidates) <= count:
        return candidates
    return candidates.select(np.argpartition(-candidates.scores, count)[:count])


def one_for_each(items: Sequence[Detection], shared: float) -> list[Detection]:
    """Keep, best first, boxes that share little with a better one.

    A box of half an object lies within the box of the whole, and overlaps it too little for the
    usual suppression, which divides by the union. Labels are treated separately.

    Args:
        items: Detections of one image.
        shared: Largest share of the smaller box that lies within the other one.
    """
    kept: list[Detection] = []
    boxes = np.zeros((0, 4))
    for item in sorted(items, key=lambda one: -one.score):
        box = np.array(item.box)
        sides = np.minimum(boxes[:, 2:], box[2:]) - np.maximum(boxes[:, :2], box[:2])
        common = np.clip(sides, 0.0, None).prod(axis=1)
        smaller = np.minimum((boxes[:, 2:] - boxes[:, :2]).prod(axis=1), item.area)
        same = np.array([one.label == item.label for one in kept], np.bool_)
        if not (same & (common > shared * smaller)).any():
            kept.append(item)
            boxes = np.vstack([boxes, box])
    return kept
