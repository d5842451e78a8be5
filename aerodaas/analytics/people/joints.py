"""Indices of the joints of a body, in the order of COCO's 17 keypoints."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "ANKLES",
    "ARMS",
    "BONES",
    "ELBOWS",
    "FACE",
    "HIPS",
    "KNEES",
    "MIRRORED",
    "POINTS",
    "SHOULDERS",
    "UPPER",
    "WRISTS",
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
    """Mask (..., 17) of the `keypoints` (..., 17, 3: u, v, confidence) that count as visible."""
    finite = np.isfinite(keypoints).all(axis=-1)
    return np.asarray(finite & (keypoints[..., 2] >= min_confidence))
