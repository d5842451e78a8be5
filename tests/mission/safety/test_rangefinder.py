"""What a rangefinder sees below: descents end before it, and a drone that is too low climbs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from flights import KinematicVehicle
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from aerodaas.clock import NANOSECONDS
from aerodaas.config.sections.robot import GeofenceConfig, LimitsConfig
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import PositionSetpoint, VehicleMode, VelocitySetpoint
from aerodaas.mission.safety.setpoint_filter import FilteredSetpoint, SetpointFilter

LIMITS = LimitsConfig(
    max_speed=4.0,
    max_climb=1.5,
    rangefinder_clearance=2.0,
    takeoff_height=3.0,
    geofence=GeofenceConfig(ceiling=40.0, floor=-50.0),
)
HERE = Odometry(np.array([0.0, 0.0, 10.0]), np.zeros(3), 0.0)


def clamped(
    below: float | None, *asked: float, limits: LimitsConfig = LIMITS, here: Odometry = HERE
) -> FilteredSetpoint:
    """What becomes of a velocity, asked for long enough to be reached."""
    guard = SetpointFilter(limits, np.zeros(3))
    return guard.clamp(VelocitySetpoint(np.array(asked)), here, 60.0, below=below)


def velocity(sent: FilteredSetpoint) -> list[float]:
    """Of a setpoint."""
    assert isinstance(sent.setpoint, VelocitySetpoint)
    return list(map(float, sent.setpoint.velocity))


@given(st.floats(0.0, 20.0))
def test_a_descent_stops_before_the_clearance(room: float) -> None:
    """Reaction and braking fill the room that is left; level flight is free."""
    sent = clamped(2.0 + room, 2.0, 0.0, -1.5)
    east, north, up = velocity(sent)
    assert (east, north) == (2.0, 0.0)
    stops_in = -up * LIMITS.reaction_time + up * up / (2 * LIMITS.max_acceleration)
    assert up == -1.5 or stops_in == pytest.approx(room, abs=2e-3)
    assert ("ground" in sent.clipped_by) == (up != -1.5)


def test_what_is_not_measured_or_not_heeded_bounds_nothing() -> None:
    """No reading, or no clearance set: the floor alone ends a descent."""
    assert clamped(None, 2.0, 0.0, -1.5).clipped_by == ()
    unset = LIMITS.model_copy(update={"rangefinder_clearance": 0.0})
    assert clamped(0.1, 2.0, 0.0, -1.5, limits=unset).clipped_by == ()


def test_a_drone_that_is_too_low_climbs_and_slows_down() -> None:
    """The nearer the slower: at half of its clearance it only climbs; at all of it, it need not."""
    assert velocity(clamped(2.0, 2.0, 0.0, 0.0)) == [2.0, 0.0, 0.0]
    for below, share in ((1.5, 0.5), (1.0, 0.0), (0.2, 0.0)):
        sent = clamped(below, 2.0, -1.0, 0.0)
        east, north, up = velocity(sent)
        assert (east, north) == pytest.approx((2.0 * share, -1.0 * share))
        assert 0.5 < up <= LIMITS.max_climb
        assert sent.clipped_by == ("ground",)
    assert velocity(clamped(1.5, 0.0, 0.0, 1.5)) == [0.0, 0.0, 1.5], "it climbs faster already"


def test_it_climbs_through_no_ceiling() -> None:
    """The fence has the last word."""
    at_ceiling = Odometry(np.array([0.0, 0.0, 40.0]), np.zeros(3), 0.0)
    assert velocity(clamped(0.5, 1.0, 0.0, 0.0, here=at_ceiling))[2] <= 0.0


def test_a_place_too_low_is_not_flown_down_to() -> None:
    """A waypoint below the clearance over something that no map has: it stays above."""
    guard = SetpointFilter(LIMITS, np.zeros(3))
    place = PositionSetpoint(np.array([0.0, 0.0, 1.0]), None, 1.0)
    sent = guard.clamp(place, HERE, 0.05, below=2.0)
    assert isinstance(sent.setpoint, VelocitySetpoint)
    assert sent.setpoint.velocity.tolist() == pytest.approx([0.0, 0.0, 0.0])


@pytest.mark.parametrize("slope", [0.1, 0.3, 0.6])
@pytest.mark.parametrize("step", [0.0, 1.2])
def test_over_rising_ground_it_is_never_met(slope: float, step: float) -> None:
    """At full speed over a slope, and a step in it, with readings a tenth of a second old."""
    guard = SetpointFilter(LIMITS, np.zeros(3))
    drone = KinematicVehicle((0.0, 0.0, 3.0))
    drone.mode = VehicleMode.GUIDED
    now, least, readings = 0, math.inf, [3.0, 3.0, 3.0]
    for _ in range(400):
        odometry = drone.read().odometry
        east, up = float(odometry.position[0]), float(odometry.position[2])
        above = up - (slope * max(0.0, east - 4.0) + (step if east > 10.0 else 0.0))
        least = min(least, above)
        readings.append(above)
        asked = VelocitySetpoint(np.array([4.0, 0.0, 0.0]))
        drone.send(guard.clamp(asked, odometry, 0.05, below=readings[-3]).setpoint)
        now += NANOSECONDS // 20
        drone.advance_to(now)
    assert least > 0.2
    assert drone.position[0] > 12.0, "it goes on over the ground"


def test_a_clearance_above_the_take_offs_height_is_refused() -> None:
    """The take-off would end in a climb; equal is enough."""
    with pytest.raises(ValidationError, match=r"takeoff_height \(3 m\) must be at least range"):
        LimitsConfig(takeoff_height=3.0, rangefinder_clearance=3.1)
    assert LimitsConfig(takeoff_height=3.0, rangefinder_clearance=3.0)
