"""Joints of a body in the order of COCO's 17 keypoints, and the crop around it for a network."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from aerodaas.geometry.frames import Box

__all__ = [
    "ANKLES",
    "ARMS",
    "BONES",
    "ELBOWS",
    "FACE",
    "GREY",
    "HIPS",
    "KNEES",
    "MARGIN",
    "MIRRORED",
    "POINTS",
    "SHOULDERS",
    "UPPER",
    "WRISTS",
    "Region",
    "cut_region",
    "square_around",
    "visible",
]

POINTS = 17
FACE, SHOULDERS, ELBOWS, WRISTS = slice(0, 5), slice(5, 7), slice(7, 9), slice(9, 11)
HIPS, KNEES, ANKLES = slice(11, 13), slice(13, 15), slice(15, 17)
UPPER = slice(0, 7)
"""Face and shoulders."""

ARMS = ((5, 7, 9), (6, 8, 10))
"""Left and right: shoulder, elbow, wrist."""

BONES = (
    *((5, 7), (7, 9), (6, 8), (8, 10), (11, 13), (13, 15), (12, 14), (14, 16)),
    *((5, 6), (11, 12), (5, 11), (6, 12), (0, 5), (0, 6)),
)
"""Pairs of joints connected by the body: limbs, then trunk and neck."""

MIRRORED = np.array([0, 2, 1, 4, 3, 6, 5, 8, 7, 10, 9, 12, 11, 14, 13, 16, 15])
"""Index of each joint in a mirrored image."""


def visible(keypoints: NDArray[np.floating[Any]], min_confidence: float) -> NDArray[np.bool_]:
    """Mask of the keypoints that count as visible.

    Args:
        keypoints: Keypoints, (..., 17, 3): u, v, confidence.
        min_confidence: Confidence below which keypoints count as missing, 0 to 1.

    Returns:
        Mask, (..., 17).
    """
    finite = np.isfinite(keypoints).all(axis=-1)
    return np.asarray(finite & (keypoints[..., 2] >= min_confidence))


Region = tuple[float, float, float, float]
"""Left, top, width, height of a part of an image, in pixels; it may reach beyond it."""

MARGIN = 1.5
"""Ratio of the square's side to the longer side of the body's box, which may omit raised arms."""

GREY = 114
"""Grey level of the crop outside the image, 0 to 255."""


def square_around(box: Box) -> Region:
    """The square around `box`, with a margin; it shows standing and lying people at one scale."""
    left, top, right, bottom = box
    side = MARGIN * max(right - left, bottom - top)
    return (left + right - side) / 2, (top + bottom - side) / 2, side, side


def cut_region(
    image: NDArray[np.uint8], region: Region, size: tuple[int, int], fill: int = GREY
) -> NDArray[np.uint8]:
    """Crop a region of a picture and resize it.

    Args:
        image: Picture, height x width x 3.
        region: Left, top, width and height in pixels of `image`, also beyond it.
        size: Width and height of the result in pixels, of the region's shape.
        fill: Grey level outside the picture, 0 to 255.
    """
    left, top, wide, high = region
    height, width = image.shape[:2]
    first = np.floor([left, top]).astype(int).clip(0, (width, height))
    last = np.ceil([left + wide, top + high]).astype(int).clip(0, (width, height))
    part = image[first[1] : last[1], first[0] : last[0]]
    if not part.size:
        return np.full((size[1], size[0], 3), fill, np.uint8)
    full = size[0] / wide
    zoom = full
    while zoom <= 0.5 and min(part.shape[:2]) > 1:  # noqa: PLR2004 - warping skips pixels below
        part = np.asarray(cv2.resize(part, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
        zoom *= 2
    scale = (last - first) / part.shape[1::-1]
    matrix = np.zeros((2, 3))
    matrix[[0, 1], [0, 1]] = full * scale
    matrix[:, 2] = (first + 0.5 * scale - 0.5 - (left, top)) * full
    warped = cv2.warpAffine(part, matrix, size, borderValue=(fill, fill, fill))
    return np.asarray(warped, np.uint8)
