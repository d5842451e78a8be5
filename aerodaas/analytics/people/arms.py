"""Detection of a raised arm from keypoints.

The lengths of the arm are checked, because a keypoint network also places joints of an arm it
cannot see, for example on a car behind.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.people.joints import ARMS, FACE, HIPS, SHOULDERS, visible

__all__ = ["raised_arm"]

_LONGEST = 0.85
"""Greatest length of an upper arm or forearm as a fraction of the trunk, shoulders to hips: they
measure 0.6 and 0.55 of it (Winter, Biomechanics and Motor Control of Human Movement, 2009, by body
height)."""

_SHORTEST = 0.7
"""Least length of a whole arm as a fraction of the trunk: an apparently shorter one points at the
lens, or is a false detection, such as a tree's crown beside the head."""
_FACE_UP, _ELBOW_UP = 0.4, 0.4
"""Height above the shoulders, as a fraction of the trunk, of the face if it is not seen, and of the
elbow of a raised arm whose wrist is not seen."""

Array = NDArray[np.float64]


def raised_arm(keypoints: NDArray[np.floating], min_confidence: float) -> bool:
    """Whether a wrist of `keypoints` (17, 3) is above the face, on an arm of human length.

    If the wrist is not seen, the elbow decides. Joints below `min_confidence` count as not seen.
    Without hips, the length of the arm is not checked.
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
