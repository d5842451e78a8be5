"""What the drone's actor refuses or prevents, in whole applications."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from flying import FLAT, Flyer, hop, recorded, robot

from aerodaas import AeroNavigation, Environment, VelocityCommand, Waypoint
from aerodaas.errors import InvalidWaypointError, MissionError


def test_two_drones_keep_their_distance(flyer: Flyer) -> None:
    """Sent to each other's place on one line, they never come nearer than the set distance."""
    limits = {"cruise_speed": 2.0, "separation": 3.0, "takeoff_height": 2.0}
    mission = {"stall_timeout": 10.0, "on_complete": "land"}
    drones = [
        robot("east", start=[20.0, 0.0, 0.0], limits=limits, mission=mission),
        robot("west", start=[0.0, 0.0, 0.0], limits=limits, mission=mission),
    ]

    def build(env: Environment) -> None:
        for name, to in (("east", 0.0), ("west", 20.0)):
            place = Waypoint(f"to-{name}", to, 0.0, 2.0, waypoint_type="local")
            env.get_robot_by_id(name).navigate(AeroNavigation(data=[place]))

    flight = recorded(flyer.fly(build, {**FLAT, "robots": drones}))
    east, west = flight.robots["east"], flight.robots["west"]
    together = min(len(east.position), len(west.position))
    apart = np.linalg.norm(east.position[:together] - west.position[:together], axis=1)
    assert 2.5 < apart.min() < 6.0
    assert "separation" in {*east.clipped, *west.clipped}
    for one in (east, west):
        assert one.outcome.startswith("landed")


@pytest.mark.parametrize(
    ("changes", "reasons"),
    [
        (
            {"start": [50.0, 0.0, 0.0], "driver": "simulated"},
            ["outside its geofence"],
        ),
        (
            {"start": [50.0, 0.0, 0.0], "settings": {"battery": 0.1}},
            ["outside its geofence", "the battery is at"],
        ),
    ],
)
def test_take_off_is_refused_with_all_reasons(
    flyer: Flyer, changes: dict[str, Any], reasons: list[str]
) -> None:
    """The mission ends on the ground, and the error lists what was wrong."""
    fence = {"polygon": [[-10, -10], [10, -10], [10, 10], [-10, 10]]}
    drone = robot(limits={"geofence": fence}, **changes)

    def build(env: Environment) -> None:
        # Not by waypoints: those outside the fence are refused before there is a take-off.
        env.get_robot_by_id("drone").navigate(AeroNavigation(data=[VelocityCommand(forward=1.0)]))

    with pytest.raises(MissionError, match="take-off refused") as refused:
        flyer.fly(build, {**FLAT, "robots": [drone]})
    for reason in reasons:
        assert reason in str(refused.value)


@pytest.mark.parametrize(
    ("waypoints", "reason"),
    [
        (hop((50, 0)), "outside the geofence"),
        (AeroNavigation(), "empty"),
        (AeroNavigation(data=[Waypoint("low", 1, 1, 0.1)]), "floor"),
        (AeroNavigation(data=[Waypoint("late", 1, 1, 2, deadline=-1.0)]), "past"),
        (
            AeroNavigation(data=[Waypoint("global", 13.0, 77.5, 930.0, waypoint_type="global")]),
            "no home",
        ),
    ],
)
def test_bad_plans_are_refused_before_the_start(
    flyer: Flyer, waypoints: AeroNavigation, reason: str
) -> None:
    """The application learns at once what is wrong with which waypoint."""
    fence = {"polygon": [[-10, -10], [10, -10], [10, 10], [-10, 10]]}
    drone = robot(limits={"geofence": fence})

    def build(env: Environment) -> None:
        env.get_robot_by_id("drone").navigate(waypoints)

    with pytest.raises(InvalidWaypointError, match=reason):
        flyer.fly(build, {**FLAT, "robots": [drone]})
