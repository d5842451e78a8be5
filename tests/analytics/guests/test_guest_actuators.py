"""A guest moves no actuator, whatever its document or its results say."""

from __future__ import annotations

import pytest

from aerodaas import AeroNavigation, Waypoint
from aerodaas.analytics.guests.payload import require_no_moves
from aerodaas.analytics.item_json import decoded, encoded
from aerodaas.errors import GraphError

MOVING = AeroNavigation(data=[Waypoint("drop", 0, 5, 2, actuate={"hook": "release"})])


def test_navigation_that_moves_is_refused() -> None:
    """As it comes out of the guest's process; all else passes as it is."""
    result = decoded(encoded(MOVING, lambda _: pytest.fail("it is navigation")))
    assert result.waypoints[0].moves == {"hook": "release"}
    with pytest.raises(GraphError, match="theirs is a guest and moves no actuators"):
        require_no_moves(result, "theirs")
    plain = AeroNavigation(data=[Waypoint("there", 0, 5, 2)])
    assert require_no_moves(plain, "theirs") is plain
    assert require_no_moves(None, "theirs") is None
