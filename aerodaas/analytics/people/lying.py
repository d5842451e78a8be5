"""Whether a body lies on the ground, told from where its joints would touch it.

Seen from behind, one who has fallen forward looks much like one who stands: the feet below, the
head above. On the ground, though, a lying body is as long as a person, while the head of one who
stands covers ground many metres behind.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.people.joints import ANKLES, HIPS, KNEES, UPPER, visible
from aerodaas.following.ground import GroundView
from aerodaas.types.data import Detections

__all__ = ["feet_below", "lies"]

_LONGEST = 2.3
"""Metres of ground that a lying body covers, at most, its joints a little above it."""

_LOW = 0.75
"""Metres: the head of one who sits or crouches is higher."""

_HIPS_LOW = (0.7, 0.51)
"""Metres above ankles and above knees; the hips of one who stands are higher."""

_PAIR = 2

_LEGS = ((ANKLES, 0.08), (KNEES, 0.5), (HIPS, 0.93))
"""Joints, and their height in metres while an adult stands (Drillis and Contini, 1966)."""

_ABOVE = 0.3
"""Metres from joints up to a camera that tells by them where somebody stands."""

_NEAREST = 0.3
"""Metres from below the camera, nearer than which angles tell nothing."""


def lies(keypoints: NDArray[np.floating], seen: Detections, min_confidence: float) -> bool | None:
    """Tell whether the body with `keypoints` (17, 3) in the frame of `seen` lies on flat ground.

    None where it cannot be told: from a camera of unknown height or calibration, without a pair of
    ankles or knees, or without two joints of head and shoulders or both hips. Each joint is taken
    to be above the nearest foot or knee, which gives its height if the body is upright.
    """
    try:
        view = GroundView(seen)
    except ValueError:
        return None
    known = visible(keypoints, min_confidence)
    upper = next((part for part in (UPPER, HIPS) if known[part].sum() >= _PAIR), None)
    lower = next((part for part in (ANKLES, KNEES) if known[part].sum() >= _PAIR), None)
    if upper is None or lower is None:
        return None
    ground = view.points(keypoints[:, :2].astype(np.float64))
    high, low = ground[upper][known[upper]], ground[lower][known[lower]]
    if np.isnan(high).any() or np.isnan(low).any():
        return False
    # One joint out of place must not decide.
    top, foot = np.median(high, axis=0), np.median(low, axis=0)
    if np.hypot(*(top - foot)) > _LONGEST:
        return False
    near = max(_NEAREST, float(np.hypot(*foot)))
    lift = view.height * (1.0 - near / max(near, float(np.hypot(*top))))
    return lift < (_LOW if upper is UPPER else _HIPS_LOW[lower is KNEES])


def feet_below(
    keypoints: NDArray[np.floating], view: GroundView, min_confidence: float
) -> NDArray[np.float64] | None:
    """Where one stands who does, metres forward and left, by the lowest pair of joints seen.

    None if that is too high for this camera to tell, or there is none.
    """
    known = visible(keypoints, min_confidence)
    for part, up in _LEGS:
        if known[part].sum() == _PAIR:
            if view.height - up < _ABOVE:
                return None
            place = view.points(keypoints[part, :2].astype(np.float64), up).mean(axis=0)
            return place if np.isfinite(place).all() else None
    return None
