"""Waypoints handed over to the own mission mode of a real autopilot, and taken back."""

from __future__ import annotations

import numpy as np
import pytest

from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.messages.waypoints import NavigationType, SchedulingType, Waypoint
from aerodaas.mission.commands import AddNavigation, HandOver, ReturnHome, TakeBack
from sitl.autopilot import Autopilot
from sitl.flights import SitlFlight

pytestmark = [pytest.mark.sitl, pytest.mark.slow, pytest.mark.timeout(420), pytest.mark.wall_clock]

STOPS = [
    Waypoint("a", 0, 20, 6),
    Waypoint("b", 20, 20, 6, hover_duration=4.0),
    Waypoint("c", 20, 0, 8, speed=2.0),
    Waypoint("d", 5, 0, 6),
]


def handed_over(url: str) -> SitlFlight:
    """A flight whose waypoints the autopilot flies."""
    order = AeroNavigation(NavigationType.DISTANCE_DRIVEN, STOPS, SchedulingType.ORDERED)
    flight = SitlFlight(url, AddNavigation(order), cruise_speed=4.0)
    try:
        flight.run_to(S.ENROUTE)
        answer = flight.tell(HandOver())
        assert answer.accepted, answer.text
        flight.run(20.0, lambda: flight.mission.handover.flies)
        assert flight.mission.handover.flies, flight.story
        flight.run(5.0, lambda: flight.modes[-1] is VehicleMode.MISSION)
    except BaseException:
        flight.close()
        raise
    return flight


def visited(flight: SitlFlight, count: int) -> None:
    """Fly until so many waypoints are visited."""
    flight.run(120.0, lambda: flight.status.visits >= count)
    assert flight.status.visits == count, flight.story


def finish(flight: SitlFlight) -> None:
    """Fly to the mission's end, with all visited in order."""
    flight.run(180.0)
    assert flight.mission.state is S.LANDED, flight.story
    assert flight.status.visited == ("a", "b", "c", "d")
    # PX4's own estimate has wandered by up to a metre meanwhile.
    assert flight.relay.witness.away < 1.5


def test_the_autopilot_flies_them_all(autopilot: Autopilot) -> None:
    """In order, with the stay at the second; then home by setpoints."""
    with handed_over(autopilot.url) as flight:
        finish(flight)
        assert S.LOITERING in flight.states
        assert flight.relay.witness.highest > 7.0
        flight.tell_outcome("four waypoints by its own mission mode")


def test_taken_back_and_handed_over_again(autopilot: Autopilot) -> None:
    """Twice: the second plan begins with what is left, not where the first one was."""
    with handed_over(autopilot.url) as flight:
        visited(flight, 1)
        flight.run(1.0)
        assert flight.tell(TakeBack()).accepted
        flight.run(5.0, lambda: flight.modes[-1] is VehicleMode.GUIDED)
        assert flight.modes[-1] is VehicleMode.GUIDED, flight.story
        visited(flight, 2)
        answer = flight.tell(HandOver())
        assert answer.accepted, answer.text
        flight.run(20.0, lambda: flight.mission.handover.flies)
        assert flight.mission.handover.flies, flight.story
        finish(flight)
        flight.tell_outcome(
            "taken back after the first of four, handed over again after the second"
        )


def test_the_drone_comes_home_when_told(autopilot: Autopilot) -> None:
    """Whatever the plan says."""
    with handed_over(autopilot.url) as flight:
        visited(flight, 1)
        flight.run(2.0)
        flight.tell(ReturnHome())
        flight.run(120.0)
        assert flight.mission.state is S.LANDED, flight.story
        assert flight.status.visited == ("a",)
        assert flight.relay.witness.away < 1.0


def test_a_ground_station_takes_over(autopilot: Autopilot) -> None:
    """Another mode while it flies the plan: hands off."""
    with handed_over(autopilot.url) as flight:
        visited(flight, 1)
        values = (1.0, 4.0, 3.0) if flight.px4 else (1.0, 5.0)
        flight.command_as_station(mavlink.MAV_CMD_DO_SET_MODE, *values)
        flight.run(10.0)
        assert flight.mission.state is S.ABORTED, flight.story
        assert "a pilot has taken over" in flight.status.reason


def test_without_us_it_comes_home(autopilot: Autopilot) -> None:
    """Nobody takes the waypoints back: after the last one it returns and lands by itself."""
    with handed_over(autopilot.url) as flight:
        flight.vehicle.connection.link.send = lambda message: None  # type: ignore[method-assign]  # noqa: ARG005
        flight.wait_for_ground(240.0)
        assert float(np.linalg.norm(flight.vehicle.read().odometry.position[:2])) < 2.0
        flight.tell_outcome("nobody takes the waypoints back")
