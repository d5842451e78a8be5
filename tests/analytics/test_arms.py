"""A raised arm is one that a body can have: joints that a network only guesses raise none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from aerodaas.analytics.people.body_pose import raised_arm
from aerodaas.simulation.skeleton import KEYPOINTS, Posture, joints

WRISTS, ELBOWS = [9, 10], [7, 8]


def seen_from(posture: Posture, turn: float = 0.0, scale: float = 100.0) -> NDArray[np.float64]:
    """Keypoints (17, 3) of a person before a level, distant camera; `scale` pixels a metre."""
    body = joints(1.75, posture)[list(KEYPOINTS)]
    across = math.cos(turn) * body[:, 1] - math.sin(turn) * body[:, 0]
    return np.column_stack([300 - scale * across, 400 - scale * body[:, 2], np.ones(17)])


@given(turn=st.floats(-math.pi, math.pi), scale=st.floats(20, 300))
def test_a_raised_hand_is_up_and_a_walkers_is_not(turn: float, scale: float) -> None:
    """From all sides and at all distances."""
    assert raised_arm(seen_from(Posture(raised=1.0), turn, scale), 0.35)
    assert not raised_arm(seen_from(Posture(travelled=0.4, stepping=1.0), turn, scale), 0.35)


def test_a_wrist_off_the_body_is_no_raised_hand() -> None:
    """A forearm as long as the trunk is a guess, and so is an elbow on a car behind."""
    points = seen_from(Posture())
    points[10, :2] = points[6, :2] + (40.0, -110.0)
    assert not raised_arm(points, 0.35)
    points = seen_from(Posture(raised=1.0))
    points[WRISTS + ELBOWS, 0] += 90.0
    assert not raised_arm(points, 0.35)


@pytest.mark.parametrize("missing", [WRISTS, list(range(5))])
def test_the_elbow_tells_where_the_wrist_is_not_seen(missing: list[int]) -> None:
    """The picture cuts off a hand, or a face looks away."""
    for raised in (False, True):
        points = seen_from(Posture(raised=float(raised)))
        points[missing, 2] = 0.1
        assert raised_arm(points, 0.35) is raised


@pytest.mark.parametrize("missing", [WRISTS + ELBOWS, [5, 6], [0, 1, 2, 3, 4, 11, 12]])
def test_what_is_not_seen_shows_nothing(missing: list[int]) -> None:
    """Nor do joints that are no numbers."""
    points = seen_from(Posture(raised=1.0))
    points[missing, 2] = 0.1
    assert not raised_arm(points, 0.35)
    points[missing] = math.nan
    assert not raised_arm(points, 0.35)


@pytest.mark.parametrize(
    ("elbow", "wrist"), [((0.18, -0.34), (0.23, -0.43)), ((0.27, -0.33), (0.33, -0.52))]
)
def test_a_trees_crown_beside_the_head_is_no_hand(
    elbow: tuple[float, float], wrist: tuple[float, float]
) -> None:
    """As a network saw it, of two who stood before a tree, in six of eight frames."""
    points = seen_from(Posture())
    trunk = points[11:13, 1].mean() - points[5:7, 1].mean()
    shoulder = points[6, :2].copy()
    points[8, :2] = shoulder + trunk * np.array(elbow)
    points[10, :2] = shoulder + trunk * np.array(wrist)
    points[:5, 1] = shoulder[1] - 0.4 * trunk
    assert not raised_arm(points, 0.35)
    points[10, 2] = 0.1
    assert not raised_arm(points, 0.35)
