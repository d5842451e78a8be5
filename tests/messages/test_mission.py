"""What a mission's status says of its waypoints."""

from __future__ import annotations

import pytest

from aerodaas.messages.mission import MissionState, MissionStatus
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.log import MissionLog
from aerodaas.terminal.panels import waypoints_text

A, B = Waypoint("a", 1, 2, 3), Waypoint("b", 1, 2, 3)


@pytest.mark.parametrize(
    ("target", "pending", "visited", "counts"),
    [
        (None, (), (), (0, 0)),
        (A, (B,), (), (0, 2)),
        (A, (B,), ("a",), (1, 2)),
        (B, (A,), ("a",), (1, 2)),
        (None, (), ("a", "b", "a"), (2, 2)),
    ],
    ids=["none", "before", "while hovering", "there again later", "twice"],
)
def test_a_waypoint_counts_once(
    target: Waypoint | None,
    pending: tuple[Waypoint, ...],
    visited: tuple[str, ...],
    counts: tuple[int, int],
) -> None:
    """However often it is visited, and also while the drone is still there."""
    log = MissionLog("drone")
    for name in visited:
        log.visit(name)
    ahead = (waypoint.id for waypoint in (target, *pending) if waypoint is not None)
    status = MissionStatus(
        0, MissionState.ENROUTE, waypoint_counts=log.waypoint_counts(ahead), visits=log.visits
    )
    assert status.waypoint_counts == counts
    share = counts[0] / counts[1] if counts[1] else 0.0
    assert status.progress == share
    words = f"{counts[0]} of {counts[1]} waypoints" if counts[1] else "no waypoints"
    assert waypoints_text(status) == (share, words)
