"""Joints of a body, in the order of COCO's 17 keypoints."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "ANKLES",
    "ARMS",
    "ELBOWS",
    "FACE",
    "HIPS",
    "KNEES",
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


def visible(keypoints: NDArray[np.floating[Any]], min_confidence: float) -> NDArray[np.bool_]:
    """Which of `keypoints` (..., 17, 3: u, v, confidence) count as seen, shape (..., 17)."""
    finite = np.isfinite(keypoints).all(axis=-1)
    return np.asarray(finite & (keypoints[..., 2] >= min_confidence))
