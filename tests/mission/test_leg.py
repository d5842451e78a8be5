"""One leg: where it looks, when it has arrived, how long it hovers, when it is given up."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aerodaas.clock import NANOSECONDS
from aerodaas.config.sections.robot import LimitsConfig
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.vehicle import VehicleMode, VehicleState
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.navigation.leg import Leg, LegPhase, setpoint_towards, unreachable
from aerodaas.mission.navigation.queue import QueuedWaypoint


def stop(
    hover: float = 0.0, *, yaw: float | None = None, speed: float | None = None
) -> QueuedWaypoint:
    """A stop at (10, 0, 2)."""
    waypoint = Waypoint("wp", 10.0, 0.0, 2.0, hover, yaw=yaw, speed=speed)
    return QueuedWaypoint(waypoint, remaining_hover=hover)


def at(x: float, yaw: float = 0.0) -> Odometry:
    """A drone at (x, 0, 2)."""
    return Odometry(np.array([x, 0.0, 2.0]), np.zeros(3), yaw)


@pytest.mark.parametrize(
    ("place", "yaw"),
    [
        ((4.0, 6.0, 5.0), math.atan2(4, 3)),
        ((2.1, 2.0, 9.0), 0.0),
        ((1.0, 3.1, 3.0), math.pi / 2),
        ((-1.0, 2.0, 3.0), math.pi),
        ((1.0, -1.0, 3.0), -math.pi / 2),
        ((2.0, 2.0, 3.0), None),
        ((1.6, 2.6, 30.0), None),
    ],
)
def test_a_drone_looks_where_it_flies(place: tuple[float, float, float], yaw: float | None) -> None:
    """Level, from (1, 2, 3); within a metre along the ground the direction says nothing."""
    setpoint = setpoint_towards(np.array(place), np.array([1.0, 2.0, 3.0]), None, 2.5)
    assert tuple(setpoint.position) == place
    assert setpoint.yaw == (None if yaw is None else pytest.approx(yaw))
    assert setpoint.speed == 2.5
    asked = setpoint_towards(np.array(place), np.array([1.0, 2.0, 3.0]), 0.7, 2.5)
    assert asked.yaw == 0.7


def test_a_waypoint_s_own_speed_and_yaw_are_flown() -> None:
    """Without a speed of its own, the drone cruises."""
    corner, here = np.array([5.0, 5.0, 2.0]), np.zeros(3)
    own = Leg(stop(yaw=1.0, speed=2.0), 0, 0.5, 10.0).setpoint(corner, here, 3.0)
    assert (own.yaw, own.speed) == (1.0, 2.0)
    plain = Leg(stop(), 0, 0.5, 10.0).setpoint(corner, here, 3.0)
    assert plain.yaw == pytest.approx(math.pi / 4)
    assert plain.speed == 3.0


@pytest.mark.parametrize(("x", "arrived"), [(9.5, True), (10.5, True), (9.49, False)])
def test_a_drone_has_arrived_at_the_radius(x: float, arrived: bool) -> None:  # noqa: FBT001
    """Of half a metre; then the stop is done, for it asks for no hover."""
    leg = Leg(stop(), 0, 0.5, 10.0)
    assert leg.stop.under_way
    phase = leg.advance(at(x), 0, 0.05)
    assert phase is (LegPhase.DONE if arrived else LegPhase.UNDER_WAY)
    assert leg.stop.arrived == arrived


@pytest.mark.parametrize(
    ("asked", "yaw", "faces"),
    [
        (0.3, 0.11, True),
        (0.3, 0.09, False),
        (0.3, 0.49, True),
        (0.3, 0.51, False),
        (math.pi - 0.05, -math.pi + 0.05, True),
    ],
)
def test_a_yaw_that_is_asked_for_is_part_of_arriving(
    asked: float,
    yaw: float,
    faces: bool,  # noqa: FBT001
) -> None:
    """Within 0.2 rad, across half a turn, too."""
    leg = Leg(stop(yaw=asked), 0, 0.5, 10.0)
    assert (leg.advance(at(10.0, yaw), 0, 0.05) is LegPhase.DONE) == faces


def test_a_hover_counts_from_the_arrival_and_ends_to_the_dot() -> None:
    """One second in halves; the time on the way there is none of it."""
    leg = Leg(stop(1.0), 0, 0.5, 10.0)
    assert leg.advance(at(0.0), 0, 5.0) is LegPhase.UNDER_WAY
    assert leg.advance(at(10.0), 0, 5.0) is LegPhase.HOVERING
    assert leg.advance(at(12.0), 0, 0.5) is LegPhase.HOVERING, "blown off, it hovers on"
    assert leg.advance(at(10.0), 0, 0.5) is LegPhase.DONE
    assert leg.stop.remaining_hover == 0.0


def test_a_leg_is_given_up_after_its_time_out_without_coming_nearer() -> None:
    """Nearer by more than 0.1 m starts the 10 s anew; 0.1 m is the noise of a position."""
    leg = Leg(stop(), 0, 0.5, 10.0)

    def look(x: float, second: float) -> LegPhase:
        return leg.advance(at(x), round(second * NANOSECONDS), 0.05)

    assert look(0.0, 1.0) is LegPhase.UNDER_WAY
    assert look(0.09, 9.0) is LegPhase.UNDER_WAY
    assert look(0.0, 11.0) is LegPhase.UNDER_WAY
    assert look(0.11, 11.0) is LegPhase.UNDER_WAY
    assert look(0.11, 21.0) is LegPhase.UNDER_WAY
    assert look(0.11, 21.01) is LegPhase.STALLED


@pytest.mark.parametrize(
    ("clearance", "below", "height", "kept"),
    [
        (3.0, 3.2, 3.0, True),
        (3.0, 3.6, 3.0, False),
        (3.0, None, 3.0, False),
        (3.0, 3.0, 2.2, False),
        (0.0, 0.4, 3.0, False),
    ],
)
def test_the_clearance_is_named_where_it_keeps_the_drone_above(
    clearance: float, below: float | None, height: float, *, kept: bool
) -> None:
    """Not far above what is below, nor as high as the place, nor where nothing is kept."""
    odometry = Odometry(np.array([10.0, 0.0, height]), np.zeros(3), 0.0)
    state = VehicleState(0, odometry, Battery(0.9), VehicleMode.GUIDED, armed=True, below=below)
    limits = LimitsConfig(rangefinder_clearance=clearance, takeoff_height=5.0)
    why = unreachable(stop(), LegPhase.STALLED, state, limits)
    assert why.startswith("wp cannot be reached: the drone comes no nearer")
    assert ("limits.rangefinder_clearance" in why) is kept
