"""Suppression of further boxes of one object, around a part of it or including its surroundings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aerodaas.messages.detections import Detection

__all__ = ["one_for_each"]


def one_for_each(items: Sequence[Detection], shared: float) -> list[Detection]:
    """Keep, best first, boxes that share at most `shared` of the smaller box with a better one.

    A box of half an object lies within the box of the whole, and overlaps it too little for the
    usual suppression, which divides by the union. Labels are treated separately.
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
