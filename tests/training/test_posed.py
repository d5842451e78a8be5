"""Bodies for the gesture classifier: rendered, and found by the networks that ship."""

from __future__ import annotations

import numpy as np
import pytest

from aerodaas.analytics.gestures import GESTURES, POINTS
from aerodaas.analytics.pose import PoseAnalytics
from aerodaas.training.posed import found_bodies

CROWN = slice(0, 7)
ANKLES = slice(15, 17)


@pytest.mark.slow
def test_bodies_are_found_with_the_gesture_that_was_posed() -> None:
    """Who stands has the head above the feet; the same seed gives the same bodies."""
    pose = PoseAnalytics(threads=1)
    pose.open()
    found = list(found_bodies(pose, 77, 3))
    again = list(found_bodies(pose, 77, 3))
    pose.close()
    assert len(found) > 15
    assert {gesture for _, gesture in found} <= set(GESTURES)
    assert all(points.shape == (POINTS, 3) for points, _ in found)
    upright = [points for points, gesture in found if gesture in {"upright", "hand_raised"}]
    assert sum(map(_is_upright, upright)) > 0.8 * len(upright)
    for (one, first), (other, second) in zip(found, again, strict=True):
        assert first == second
        np.testing.assert_array_equal(one, other)


def _is_upright(points: np.ndarray) -> bool:
    return bool(points[CROWN, 1].mean() < points[ANKLES, 1].mean())
