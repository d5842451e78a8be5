"""Whether the joints that were found make an arm that is held up.

A keypoint network that does not see an arm puts it somewhere all the same, such as on a car behind.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.people.joints import ARMS, FACE, HIPS, SHOULDERS, visible

__all__ = ["raised_arm"]

_LONGEST = 0.85
"""Of the trunk, shoulders to hips: an upper arm measures 0.6 of it and a forearm 0.55 (Winter,
Biomechanics and Motor Control of Human Movement, 2009, by body height)."""

_SHORTEST = 0.7
"""Of the trunk, both parts of an arm together: one that seems shorter points at the lens, or is
none, such as a tree's crown beside the head."""
_FACE_UP, _ELBOW_UP = 0.4, 0.4
"""Of the trunk above the shoulders: the face, and the elbow of an arm whose wrist is not seen."""

Array = NDArray[np.float64]


def raised_arm(keypoints: NDArray[np.floating], min_confidence: float) -> bool:
    """Tell whether a wrist of `keypoints` (17, 3) is above the face, on an arm of human length.

    Where the wrist is not seen, the elbow tells. Joints of less than `min_confidence` are not seen,
    and show nothing. Without hips, a wrist above the face is taken at its word.
    """
    points = keypoints[:, :2].astype(np.float64)
    seen = visible(keypoints, min_confidence)
    if not seen[SHOULDERS].any():
        return False
    shoulders = points[SHOULDERS][seen[SHOULDERS]].mean(axis=0)
    trunk = math.inf
    if seen[HIPS].any():
        trunk = float(np.hypot(*(points[HIPS][seen[HIPS]].mean(axis=0) - shoulders)))
    face = points[FACE][seen[FACE], 1]
    top = float(face.mean()) if len(face) else shoulders[1] - _FACE_UP * trunk
    return any(_is_up(points[list(arm)], seen[list(arm)], trunk, top) for arm in ARMS)


def _is_up(arm: Array, seen: NDArray[np.bool_], trunk: float, top: float) -> bool:
    lengths = np.linalg.norm(np.diff(arm, axis=0), axis=1)
    if not seen[:2].all() or lengths[0] > _LONGEST * trunk:
        return False
    if not seen[2]:
        return bool(arm[0, 1] - arm[1, 1] >= _ELBOW_UP * trunk)
    if math.isfinite(trunk) and lengths.sum() < _SHORTEST * trunk:
        return False
    return bool(lengths[1] <= _LONGEST * trunk and arm[2, 1] < top)
