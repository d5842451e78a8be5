"""Waypoints and commands: what no vehicle could fly is refused, the rest stays what it was."""

from __future__ import annotations

import dataclasses
import math
import pickle
import typing
from typing import Any

import numpy as np
import pytest
from filled import filled
from hypothesis import given
from hypothesis import strategies as st

from aerodaas import (
    AeroListData,
    AeroNavigation,
    HeightReference,
    NavigationType,
    PriorityQueue,
    SchedulingType,
    VelocityCommand,
    Waypoint,
    WaypointType,
)
from aerodaas.errors import InvalidWaypointError
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.messages.actions import Action, action_kinds
from aerodaas.messages.serialization.schema import MessageError, json_of, message_of
from aerodaas.messages.waypoints import HeightDatum

finite = st.floats(-1e4, 1e4)
bad = st.sampled_from([math.nan, math.inf, -math.inf])
waypoints = st.builds(
    Waypoint,
    st.text(min_size=1, max_size=8),
    finite,
    finite,
    finite,
    hover_duration=st.floats(0, 100),
    waypoint_type=st.sampled_from(["relative", "local"]),
    yaw=st.none() | finite,
    speed=st.none() | st.floats(0.01, 20),
    priority=st.integers(-5, 20),
    deadline=st.none() | st.floats(0, 1e4),
)


@given(waypoints)
def test_waypoints_survive_the_way_to_another_process(waypoint: Waypoint) -> None:
    """Pickling is the identity."""
    assert pickle.loads(pickle.dumps(waypoint)) == waypoint  # noqa: S301 - our own bytes


HOME = GeodeticOrigin(47.0, 8.0, 585.0)


@given(finite, st.sampled_from(list(WaypointType)), st.floats(-400, 5000))
def test_a_height_counts_from_what_the_waypoint_says(
    z: float, kind: WaypointType, sea_level: float
) -> None:
    """Whatever its x and y are; the ground's height is asked at its own place."""
    places: list[tuple[float, float]] = []

    def ground(east: float, north: float) -> float:
        places.append((east, north))
        return 33.0

    datum = HeightDatum(sea_level, ground)
    takeoff = np.array([7.0, -9.0, 2.0])
    on_globe = kind in {WaypointType.GLOBAL, WaypointType.GLOBAL_RELATIVE}
    x, y = (47.001, 8.001) if on_globe else (12.0, 34.0)
    at: dict[HeightReference, float] = {}
    plain = Waypoint("a", x, y, z, waypoint_type=kind).resolve(takeoff, HOME)
    for above in HeightReference:
        asked = Waypoint("a", x, y, z, waypoint_type=kind, above=above.value)
        found = asked.resolve(takeoff, HOME, datum)
        assert found.resolve(takeoff, HOME) == found
        at[above] = found.z
    assert at[HeightReference.HOME] == z
    assert at[HeightReference.SEA] == pytest.approx(z - sea_level)
    assert at[HeightReference.GROUND] == pytest.approx(z + 33.0)
    assert places == [pytest.approx((plain.x, plain.y), abs=0.2)]


@pytest.mark.parametrize(
    ("above", "datum", "why"),
    [
        ("sea", HeightDatum(ground=lambda *_: 1.0), "give home.above_sea"),
        ("ground", HeightDatum(sea_level=500.0), "names no terrain"),
        ("ground", HeightDatum(ground=lambda *_: math.nan), "the terrain does not know"),
    ],
)
def test_a_height_is_never_guessed(above: str, datum: HeightDatum, why: str) -> None:
    """What it is counted from must be known itself."""
    with pytest.raises(InvalidWaypointError, match=why):
        Waypoint("a", 1, 2, 3, above=above).resolve(np.zeros(3), HOME, datum)


def test_heights_count_from_home_sea_or_ground_alone() -> None:
    """Anything else is refused, with the choices."""
    with pytest.raises(InvalidWaypointError, match="must be one of home, sea, ground, not 'roof'"):
        Waypoint("a", 1, 2, 3, above="roof")


@given(waypoints, st.tuples(finite, finite, finite))
def test_resolving_ends_in_the_local_frame(
    waypoint: Waypoint, takeoff: tuple[float, float, float]
) -> None:
    """Relative places move with the take-off, local ones stay; once resolved, nothing changes."""
    resolved = waypoint.resolve(np.array(takeoff), None)
    moved = waypoint.waypoint_type is WaypointType.RELATIVE
    np.testing.assert_allclose(
        resolved.position, waypoint.position + (np.array(takeoff) if moved else 0), atol=1e-9
    )
    assert resolved.waypoint_type is WaypointType.LOCAL
    assert resolved.resolve(np.array([9.0, 9.0, 9.0]), None) == resolved
    assert (resolved.id, resolved.priority, resolved.speed) == (
        waypoint.id,
        waypoint.priority,
        waypoint.speed,
    )


@given(finite, finite, st.floats(0, 120))
def test_a_global_waypoint_is_where_its_degrees_are(east: float, north: float, up: float) -> None:
    """Degrees made from a place lead back to it."""
    origin = GeodeticOrigin(13.0, 77.5, 900.0)
    latitude, longitude, altitude = origin.to_geodetic(np.array([east, north, up]))
    waypoint = Waypoint("g", latitude, longitude, altitude, waypoint_type="global")
    resolved = waypoint.resolve(np.zeros(3), origin)
    np.testing.assert_allclose(resolved.position, [east, north, up], atol=1e-3)
    with pytest.raises(InvalidWaypointError, match="gives no home"):
        waypoint.resolve(np.zeros(3), None)


@given(bad, st.sampled_from(["x", "y", "z", "hover_duration", "yaw", "speed", "deadline"]))
def test_numbers_that_are_none_are_refused_by_name(value: float, field: str) -> None:
    """NaN and infinities name the waypoint and the field."""
    values: dict[str, Any] = {"x": 0.0, "y": 0.0, "z": 0.0, field: value}
    with pytest.raises(InvalidWaypointError, match=f"waypoint 'w': {field} must be a finite"):
        Waypoint("w", **values)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"x": "1"}, "x must be a finite number, not '1'"),
        ({"hover_duration": -1}, "hover_duration must not be negative"),
        ({"speed": 0}, "speed must be positive"),
        (
            {"waypoint_type": "lunar"},
            "must be one of relative, local, global, global_relative, not 'lunar'",
        ),
        ({"x": 91, "waypoint_type": "global"}, "is no latitude and longitude"),
        ({"y": 181, "waypoint_type": "global"}, "is no latitude and longitude"),
    ],
)
def test_values_that_cannot_be_flown(values: dict[str, Any], message: str) -> None:
    """Each is refused with a reason."""
    with pytest.raises(InvalidWaypointError, match=message):
        Waypoint("w", **dict[str, Any]({"x": 0, "y": 0, "z": 1, **values}))


@given(bad, st.sampled_from(["forward", "left", "up", "yaw_rate", "valid_for"]))
def test_velocities_that_are_none_are_refused(value: float, field: str) -> None:
    """A controller's NaN never reaches a drone."""
    with pytest.raises(InvalidWaypointError, match=field):
        VelocityCommand(**dict[str, Any]({field: value}))


@given(st.lists(waypoints, unique_by=lambda waypoint: waypoint.id, max_size=6))
def test_navigation_keeps_its_items_in_order(items: list[Waypoint]) -> None:
    """A navigation is the list that it was made of; a priority given is that of each item."""
    navigation = AeroNavigation(NavigationType.DISTANCE_DRIVEN, items)
    assert list(navigation) == navigation.getData() == navigation.waypoints == items
    assert navigation.commands == []
    urgent: PriorityQueue[Waypoint] = PriorityQueue(AeroListData(items), priority=1)
    assert [item.priority for item in urgent] == [1] * len(items)
    assert [item.position.tolist() for item in urgent.waypoints] == [
        item.position.tolist() for item in items
    ]


def test_a_priority_queue_keeps_whether_it_may_be_reordered() -> None:
    """Wrapping navigation changes its priority only."""
    survey = AeroNavigation("distance_driven", [Waypoint("a", 1, 2, 3)], "unordered")  # type: ignore[arg-type]
    queue: PriorityQueue[Waypoint] = PriorityQueue(survey, priority=2)
    assert queue.scheduling_type is SchedulingType.UNORDERED
    assert queue.priority == 2


def test_what_is_no_navigation_is_refused() -> None:
    """Other things, data in the place of the type, two waypoints of one id."""
    with pytest.raises(InvalidWaypointError, match=r"takes waypoints and velocity commands"):
        AeroNavigation(NavigationType.DISTANCE_DRIVEN, [(1, 2, 3)])  # type: ignore[list-item]
    with pytest.raises(InvalidWaypointError, match=r"write AeroNavigation\(data=\[...\]\)"):
        AeroNavigation([Waypoint("a", 1, 2, 3)])  # type: ignore[arg-type]
    twice = [Waypoint("a", 1, 2, 3), Waypoint("a", 2, 2, 3)]
    with pytest.raises(InvalidWaypointError, match="two waypoints are called 'a'"):
        AeroNavigation(NavigationType.DISTANCE_DRIVEN, twice)


@given(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(-50, 500), st.floats(-100, 3000))
def test_a_height_above_home_is_kept_wherever_home_lies(
    north: float, east: float, height: float, altitude: float
) -> None:
    """Also kilometres away, where home's tangent plane is metres above home's level."""
    home = GeodeticOrigin(47.0, 8.0, altitude)
    waypoint = Waypoint("w", 47 + north, 8 + east, height, waypoint_type="global_relative")
    local = waypoint.resolve(np.zeros(3), home)
    assert local.waypoint_type is WaypointType.LOCAL
    assert local.z == height
    level = home.to_local(47 + north, 8 + east, altitude)
    assert (local.x, local.y) == (level[0], level[1])


@pytest.mark.parametrize("kind", ["global", "global_relative"])
def test_places_on_the_globe_are_on_it(kind: str) -> None:
    """Latitude and longitude in degrees, and a home to fly them from."""
    with pytest.raises(InvalidWaypointError, match="is no latitude and longitude"):
        Waypoint("w", 91, 8, 1, waypoint_type=kind)
    with pytest.raises(InvalidWaypointError, match="the environment file gives no home"):
        Waypoint("w", 47, 8, 1, waypoint_type=kind).resolve(np.zeros(3), None)


ACTIONS = tuple(action_kinds().values())


def numbers_of(kind: Any) -> list[str]:  # noqa: ANN401 - a dataclass
    """Names of a dataclass' fields that hold numbers."""
    hints = typing.get_type_hints(kind)
    numbers = {name for name, it in hints.items() if {float, int} & {it, *typing.get_args(it)}}
    return [one.name for one in dataclasses.fields(kind) if one.name in numbers]


@pytest.mark.parametrize("kind", [Waypoint, VelocityCommand, *ACTIONS])
def test_each_number_is_finite(kind: Any) -> None:  # noqa: ANN401 - a dataclass
    """A field that holds numbers and takes one that is none would reach the autopilot."""
    for name in set(numbers_of(kind)) - {"priority"}:
        with pytest.raises(InvalidWaypointError, match=f"{name} must be a finite number"):
            filled(kind, **{name: math.nan})


@pytest.mark.parametrize("value", [1e308, -1e308, 10**400, 1.1e9])
@pytest.mark.parametrize("kind", [Waypoint, *ACTIONS])
def test_each_number_can_be_counted_in_nanoseconds(kind: Any, value: float) -> None:  # noqa: ANN401
    """A larger one would overflow in flight: in a clock, or in a distance that is squared."""
    for name in numbers_of(kind):
        with pytest.raises(InvalidWaypointError, match=name):
            filled(kind, **{name: value})


def test_numbers_are_found() -> None:
    """Of a waypoint."""
    assert {"hover_duration", "deadline", "priority", "x"} <= set(numbers_of(Waypoint))


@pytest.mark.parametrize("kind", ACTIONS, ids=lambda kind: kind.__name__)
def test_a_waypoint_brings_each_kind_of_action_across(kind: type[Action]) -> None:
    """As JSON and by pickle, with a value in each field."""
    waypoint = Waypoint("a", 1, 2, 3, actions=[filled(kind)])
    assert message_of(Waypoint, json_of(waypoint)) == waypoint
    assert pickle.loads(pickle.dumps(waypoint)) == waypoint  # noqa: S301 - our own bytes
    assert [type(action) for action in waypoint.actions] == [kind]


def test_an_unknown_action_is_refused() -> None:
    """By keyword, and in JSON."""
    with pytest.raises(InvalidWaypointError, match="a waypoint has no fotos"):
        Waypoint("w", 1, 2, 3, fotos=True)  # type: ignore[call-arg]
    with pytest.raises(MessageError, match="on_fire"):
        message_of(Waypoint, {"id": "w", "x": 1, "y": 2, "z": 3, "actions": [{"type": "on_fire"}]})
