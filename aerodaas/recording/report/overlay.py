"""Drawing of boxes, keypoints and text into an image, in the style of Foxglove's overlays."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterable
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.messages.detections import Detection

__all__ = [
    "OKABE_ITO",
    "STATE_COLOURS",
    "VISIBLE",
    "draw_detections",
    "draw_line",
    "label_colour",
    "rgb",
]

OKABE_ITO = {
    "black": "#000000",
    "orange": "#E69F00",
    "sky": "#56B4E9",
    "green": "#009E73",
    "yellow": "#F0E442",
    "blue": "#0072B2",
    "vermilion": "#D55E00",
    "purple": "#CC79A7",
    "grey": "#999999",
}
"""The eight colours of https://jfly.uni-koeln.de/color/, and a neutral grey."""

STATE_COLOURS = {
    "idle": OKABE_ITO["grey"],
    "preflight": OKABE_ITO["grey"],
    "taking_off": OKABE_ITO["sky"],
    "holding": OKABE_ITO["yellow"],
    "enroute": OKABE_ITO["blue"],
    "loitering": OKABE_ITO["orange"],
    "following": OKABE_ITO["green"],
    "diverted": OKABE_ITO["vermilion"],
    "paused": OKABE_ITO["yellow"],
    "returning": OKABE_ITO["purple"],
    "landing": OKABE_ITO["sky"],
    "landed": OKABE_ITO["grey"],
    "aborted": OKABE_ITO["black"],
}
"""Colour of each mission state; states that never follow one another may share one."""

_LABELS = ("orange", "sky", "green", "yellow", "blue", "vermilion", "purple")
_FONT = cv2.FONT_HERSHEY_SIMPLEX
VISIBLE = 0.3
"""Least confidence of a keypoint that is drawn, and that is called seen."""
_REFERENCE = 640
"""Image width in pixels at which lines are two pixels wide and text has half the font's size."""

Image = NDArray[np.uint8]


def rgb(colour: str) -> tuple[float, float, float]:
    """Red, green and blue, each 0 to 1, of `#RRGGBB`."""
    red, green, blue = (int(colour[index : index + 2], 16) / 255 for index in (1, 3, 5))
    return red, green, blue


@lru_cache(maxsize=1024)
def label_colour(label: str) -> str:
    """Colour of a detection label, the same in every recording."""
    return OKABE_ITO[_LABELS[zlib.crc32(label.encode()) % len(_LABELS)]]


def draw_detections(image: Image, found: Iterable[Detection]) -> None:
    """Draw detections into a picture, each in the colour of its label.

    Args:
        image: Picture, height x width x 3, BGR; changed in place.
        found: The detections, in its pixels.
    """
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
    """Write one line of text into the lower left corner of a picture.

    Args:
        image: Picture, height x width x 3, BGR; changed in place.
        text: The line.
    """
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
