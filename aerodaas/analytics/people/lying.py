"""Detection of a lying body by the projection of its joints onto the ground.

Seen from behind, a person who has fallen forward resembles a standing one: feet below, head
above. Projected onto the ground, however, a lying body is as long as a person, while the head of
a standing one is projected many metres behind the feet.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerodaas.analytics.people.joints import ANKLES, HIPS, KNEES, UPPER, visible
from aerodaas.following.ground_point import GroundView
from aerodaas.messages.detections import Detections

__all__ = ["feet_below", "lies"]

_LONGEST = 2.3
"""Greatest length in metres of a lying body projected onto the ground, from slightly above it."""

_LOW = 0.75
"""Greatest height of a lying person's head in metres; sitting or crouching, it is higher."""

_HIPS_LOW = (0.7, 0.51)
"""Greatest height of a lying person's hips above ankles and above knees in metres; standing, they
are higher."""

_PAIR = 2

_LEGS = ((ANKLES, 0.08), (KNEES, 0.5), (HIPS, 0.93))
"""Joints, and their height in metres in a standing adult (Drillis and Contini, 1966)."""

_ABOVE = 0.3
"""Least height in metres of the camera above joints that locate a standing person."""

_NEAREST = 0.3
"""Horizontal distance from the camera in metres, below which angles are not meaningful."""


def lies(keypoints: NDArray[np.floating], seen: Detections, min_confidence: float) -> bool | None:
    """Whether a body lies on flat ground.

    Each joint is assumed to be above the nearest foot or knee, which gives its height if the body
    is upright.

    Args:
        keypoints: Keypoints of the body, (17, 3): u and v in pixels, and confidence.
        seen: Frame in which it is.
        min_confidence: Confidence below which keypoints count as missing, 0 to 1.

    Returns:
        None if undecidable: for a camera of unknown height or calibration, without a pair of ankles
        or knees, or without two joints of head and shoulders or both hips.
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
    # Medians, so that one misplaced joint does not decide.
    top, foot = np.median(high, axis=0), np.median(low, axis=0)
    if np.hypot(*(top - foot)) > _LONGEST:
        return False
    near = max(_NEAREST, float(np.hypot(*foot)))
    lift = view.height * (1.0 - near / max(near, float(np.hypot(*top))))
    return lift < (_LOW if upper is UPPER else _HIPS_LOW[lower is KNEES])


def feet_below(
    keypoints: NDArray[np.floating], view: GroundView, min_confidence: float
) -> NDArray[np.float64] | None:
    """Position of a standing person by the lowest visible joint pair.

    Args:
        keypoints: Keypoints of the person, (17, 3): u and v in pixels, and confidence.
        view: The camera over the ground.
        min_confidence: Confidence below which keypoints count as missing, 0 to 1.

    Returns:
        Metres forward and left, (2,); None if that pair is too high for this camera, or if no pair
        is visible.
    """
    known = visible(keypoints, min_confidence)
    for part, up in _LEGS:
        if known[part].sum() == _PAIR:
            if view.height - up < _ABOVE:
                return None
            place = view.points(keypoints[part, :2].astype(np.float64), up).mean(axis=0)
            return place if np.isfinite(place).all() else None
    return None
