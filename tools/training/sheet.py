"""A contact sheet of renders with their labels, to be looked at before any training."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from tools.training.dataset import Sample
from tools.training.rendering import render_world

__all__ = ["contact_sheet", "drawn"]

_COLOURS = ((40, 40, 255), (255, 140, 30), (30, 220, 255), (255, 60, 255))
"""Of vest, person, car, tower; BGR."""

_ROWS, _COLUMNS = 5, 4
_TILE = (416, 312)


def drawn(sample: Sample) -> NDArray[np.uint8]:
    """The picture with its boxes, and keypoints as dots: white ones seen, black ones hidden."""
    image = sample.image.copy()
    for kind, box, points in zip(sample.kinds, sample.boxes, sample.keypoints, strict=True):
        left, top, right, bottom = box.round().astype(int).tolist()
        cv2.rectangle(image, (left, top), (right - 1, bottom - 1), _COLOURS[kind], 1)
        for u, v, state in points.tolist():
            if state:
                shade = (255, 255, 255) if state > 1 else (0, 0, 0)
                cv2.circle(image, (int(u), int(v)), 1, shade, -1)
    return image


def contact_sheet(first: int) -> NDArray[np.uint8]:
    """Four labelled pictures of each of five worlds, from seed `first` on."""
    rows = []
    for seed in range(first, first + _ROWS):
        tiles = []
        for sample in render_world(seed, _COLUMNS):
            tile = np.full((_TILE[1], _TILE[0], 3), 30, np.uint8)
            picture = drawn(sample)[: _TILE[1]]
            tile[: len(picture)] = picture
            tiles.append(tile)
        rows.append(np.hstack(tiles))
    return np.vstack(rows)
