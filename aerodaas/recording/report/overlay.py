"""Drawing of boxes, keypoints and text into an image, in the style of Foxglove's overlays."""

from __future__ import annotations

import math
from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.messages.detections import Detection
from aerodaas.recording.report.palette import label_colour

__all__ = ["VISIBLE", "draw_detections", "draw_line"]

_FONT = cv2.FONT_HERSHEY_SIMPLEX
VISIBLE = 0.3
"""Least confidence of a keypoint that is drawn, and that is called seen."""
_REFERENCE = 640
"""Image width in pixels at which lines are two pixels wide and text has half the font's size."""

Image = NDArray[np.uint8]


def draw_detections(image: Image, found: Iterable[Detection]) -> None:
    """Draw each detection into `image` (BGR, in place), in the colour of its label."""
    scale = image.shape[1] / _REFERENCE
    width = max(1, round(2 * scale))
    for item in found:
        colour = _bgr(label_colour(item.label))
        left, top, right, bottom = (round(edge) for edge in item.box)
        cv2.rectangle(image, (left, top), (right, bottom), (0, 0, 0), 2 * width)
        cv2.rectangle(image, (left, top), (right, bottom), colour, width)
        if item.keypoints is not None:
            for u, v, confidence in item.keypoints.tolist():
                if confidence >= VISIBLE and math.isfinite(u + v):
                    cv2.circle(image, (round(u), round(v)), 2 * width, colour, -1)
        track = f" #{item.track_id}" if item.track_id is not None else ""
        text = f"{item.label}{track} {item.score:.2f}"
        _write(image, text, (left, top - round(5 * scale)), 0.5 * scale)


def draw_line(image: Image, text: str) -> None:
    """Write one line of text into the lower left corner of `image`, in place."""
    scale = image.shape[1] / _REFERENCE
    _write(image, text, (round(6 * scale), image.shape[0] - round(8 * scale)), 0.5 * scale)


def _write(image: Image, text: str, at: tuple[int, int], size: float) -> None:
    """Write white text on black inside the image; the font has ASCII only."""
    text = text.encode("ascii", "replace").decode()
    weight = max(1, round(2 * size))
    (width, height), below = cv2.getTextSize(text, _FONT, size, weight)
    x = min(max(0, at[0]), max(0, image.shape[1] - width))
    y = min(max(height + below, at[1]), image.shape[0] - below)
    corners = (x, y - height - below // 2), (x + width, y + below)
    cv2.rectangle(image, *corners, (0, 0, 0), -1)
    cv2.putText(image, text, (x, y), _FONT, size, (255, 255, 255), weight, cv2.LINE_AA)


def _bgr(colour: str) -> tuple[int, int, int]:
    red, green, blue = (int(colour[index : index + 2], 16) for index in (1, 3, 5))
    return blue, green, red
