"""Square crops around bodies, the input of a keypoint network."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["CUT", "GREY", "MARGIN", "cut_out", "square_around"]

CUT = 128
"""Side of the crop in pixels."""

MARGIN = 1.5
"""Ratio of the square's side to the longer side of the body's box, which may omit raised arms."""

GREY = 114
"""Grey level of the crop outside the image, 0 to 255."""


def square_around(
    box: tuple[float, float, float, float], margin: float = MARGIN
) -> tuple[float, float, float]:
    """Left, top and side, in pixels, of the square around `box` (left, top, right, bottom).

    A square shows standing and lying people at one scale.
    """
    left, top, right, bottom = box
    side = margin * max(right - left, bottom - top)
    return (left + right - side) / 2, (top + bottom - side) / 2, side


def cut_out(
    image: NDArray[np.uint8], square: tuple[float, float, float], size: int = CUT
) -> NDArray[np.uint8]:
    """Crop a square (left, top, side) of `image` to size x size pixels; grey outside the image."""
    left, top, side = square
    height, width = image.shape[:2]
    first = np.floor([left, top]).astype(int).clip(0, (width, height))
    last = np.ceil([left + side, top + side]).astype(int).clip(0, (width, height))
    part = image[first[1] : last[1], first[0] : last[0]]
    if not part.size:
        return np.full((size, size, 3), GREY, np.uint8)
    zoom = size / side
    while zoom <= 0.5 and min(part.shape[:2]) > 1:  # noqa: PLR2004 - warping skips pixels below
        part = np.asarray(cv2.resize(part, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
        zoom *= 2
    scale = (last - first) / part.shape[1::-1]
    matrix = np.zeros((2, 3))
    matrix[[0, 1], [0, 1]] = size / side * scale
    matrix[:, 2] = (first + 0.5 * scale - 0.5 - (left, top)) * size / side
    warped = cv2.warpAffine(part, matrix, (size, size), borderValue=(GREY, GREY, GREY))
    return np.asarray(warped, np.uint8)
