"""One frame in all tools: headings by the compass, places counted from home."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.errors import ConfigError
from aerodaas.extensions.agents.frames import (
    HEADING,
    document_waypoints,
    heading_of_yaw,
    tool_waypoints,
    yaw_of_heading,
)

ANGLES = st.floats(-1e6, 1e6)


@given(ANGLES)
def test_a_heading_points_where_the_yaw_points(yaw: float) -> None:
    """East and north of a compass heading are those of the yaw that it stands for."""
    heading = math.radians(heading_of_yaw(yaw))
    assert math.isclose(math.sin(heading), math.cos(yaw), abs_tol=1e-6)
    assert math.isclose(math.cos(heading), math.sin(yaw), abs_tol=1e-6)


@given(st.floats(0, 360))
def test_a_heading_comes_back(heading: float) -> None:
    """What a tool was told as a heading it tells as the same one."""
    difference = heading_of_yaw(yaw_of_heading(heading)) - heading
    assert math.isclose(math.remainder(difference, 360.0), 0.0, abs_tol=1e-9)


@given(ANGLES)
def test_angles_stay_within_one_turn(angle: float) -> None:
    """Each has one spelling."""
    assert 0.0 <= heading_of_yaw(angle) < 360.0
    assert -math.pi - 1e-12 <= yaw_of_heading(angle) <= math.pi + 1e-12


@pytest.mark.parametrize(
    ("heading", "yaw"), [(0, math.pi / 2), (90, 0.0), (180, -math.pi / 2), (270, math.pi)]
)
def test_the_four_quarters(heading: float, yaw: float) -> None:
    """North is a quarter to the left of east."""
    assert math.isclose(math.remainder(yaw_of_heading(heading) - yaw, 2 * math.pi), 0, abs_tol=1e-9)


def test_a_waypoint_is_local_and_has_its_heading() -> None:
    """The document counts from the place of take-off unless it says otherwise; tools do not."""
    (found,) = document_waypoints([{"id": "a", "x": 1, "y": 2, "z": 3, HEADING: 90}], "w")
    assert found == {"id": "a", "x": 1, "y": 2, "z": 3, "waypoint_type": "local", "yaw": 0.0}
    (shown,) = tool_waypoints([found])
    assert (shown["yaw"], shown[HEADING]) == (0.0, 90.0)
    (bare,) = tool_waypoints([{"id": "b", "x": 1, "y": 2, "z": 3}])
    assert HEADING not in bare


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"yaw": 0.0}, [HEADING, "90"]),
        ({"waypoint_type": "relative"}, ["waypoint_type", "local"]),
        ({"heading_deg": 5}, ["heading_deg", HEADING]),
        ({"hight": 5}, ["hight"]),
        ({"actions": [{"type": "aim_gimbal", "pich": 1}]}, ["actions.0.pich", "pitch"]),
        ({HEADING: 361}, [HEADING, "361"]),
        ({HEADING: "north"}, [HEADING]),
        ({HEADING: True}, [HEADING]),
        ({HEADING: math.nan}, [HEADING]),
    ],
)
def test_what_is_of_another_frame_is_refused_by_name(
    change: dict[str, Any], names: list[str]
) -> None:
    """A refusal names the waypoint, the field and what it may be."""
    waypoint = {"id": "a", "x": 1, "y": 2, "z": 3, **change}
    with pytest.raises(ConfigError) as caught:
        document_waypoints([{"id": "b", "x": 0, "y": 0, "z": 1}, waypoint], "navigation.0")
    assert all(name in str(caught.value) for name in ["navigation.0.1", *names])


@pytest.mark.parametrize("waypoints", [None, {}, "x", [1], [[1, 2, 3]]])
def test_waypoints_are_objects(waypoints: object) -> None:
    """Anything else is refused before it is looked into."""
    with pytest.raises(ConfigError, match="id, x, y and z"):
        document_waypoints(waypoints, "w")
