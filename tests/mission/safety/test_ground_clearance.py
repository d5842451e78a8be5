"""The ground: never nearer than the clearance, never where it is not known, never stuck."""

from __future__ import annotations

import math

import numpy as np
import pytest
from flights import KinematicVehicle, add, flight
from grounds import ORIGIN, Shape, clearance, ground
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import GeofenceConfig, LimitsConfig
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import PositionSetpoint, Setpoint, VehicleMode, VelocitySetpoint
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import ReturnHome
from aerodaas.mission.safety.setpoint_filter import SetpointFilter

Array = NDArray[np.float64]
LIMITS = LimitsConfig(
    max_speed=5.0,
    cruise_speed=4.0,
    max_range=150.0,
    takeoff_height=8.0,
    geofence=GeofenceConfig(floor=-50.0, ceiling=100.0),
)
KEPT = 5.0


def _hills(east: Array, north: Array) -> Array:
    """Up to 12 m high, and half as steep as a stair."""
    return 6.0 * (1 - np.cos(east / 9.0) * np.cos(north / 11.0))


def _swell(east: Array, north: Array) -> Array:
    """Up to 12 m high, 80 m from home."""
    return 6.0 * (1 - np.cos(east / 25.0)) + 0.0 * north


def _wall(east: Array, north: Array) -> Array:
    """20 m high from 40 m east, as steep as samples can be."""
    return np.where(east > 40.0, 20.0, 0.0) + 0.0 * north


def _hole(east: Array, north: Array) -> Array:
    """Flat, and not known within 15 m of a place 50 m east."""
    return np.where(np.hypot(east - 50.0, north) < 15.0, np.nan, 0.0)


def at(*position: float, velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Odometry:
    """Odometry of a drone that is here."""
    return Odometry(np.array(position), np.array(velocity), 0.0)


def _guard(shape: Shape, limits: LimitsConfig = LIMITS) -> SetpointFilter:
    return SetpointFilter(limits, np.zeros(3), clearance=clearance(shape, limits, KEPT))


def _flown(
    guard: SetpointFilter, vehicle: KinematicVehicle, setpoint: Setpoint, seconds: float
) -> list[NDArray[np.float64]]:
    """Positions while the vehicle is sent this setpoint, through the guard, for so long."""
    track = []
    for _ in range(round(20 * seconds)):
        state = vehicle.read()
        vehicle.send(guard.clamp(setpoint, state.odometry, 0.05).setpoint)
        vehicle.advance_to(state.stamp + NANOSECONDS // 20)
        track.append(vehicle.position.copy())
    return track


def _in_the_air(*position: float) -> KinematicVehicle:
    vehicle = KinematicVehicle((0.0, 0.0, -100.0))
    vehicle.position = np.array(position)
    vehicle.mode = VehicleMode.GUIDED
    return vehicle


sideways, far = st.floats(-8, 8), st.floats(-60, 60)
setpoints = st.builds(
    lambda *axes: VelocitySetpoint(np.array(axes)), sideways, sideways, st.floats(-4, 4)
) | st.builds(lambda *axes: PositionSetpoint(np.array(axes)), far, far, st.floats(-9, 40))


@given(asked=st.lists(setpoints, min_size=1, max_size=4), height=st.floats(5.0, 20.0))
@settings(max_examples=15)
@example(asked=[VelocitySetpoint(np.array([5.0, 0.0, -1.5]))], height=20.0)
@example(asked=[PositionSetpoint(np.array([60.0, 40.0, -5.0]))], height=6.0)
def test_no_sequence_of_setpoints_comes_too_near_to_the_ground(
    asked: list[Setpoint], height: float
) -> None:
    """Over hills, with a sluggish vehicle, whatever is asked for seconds each."""
    guard, vehicle = _guard(_hills), _in_the_air(0.0, 0.0, height)
    land = ground(_hills)
    for setpoint in asked:
        for place in _flown(guard, vehicle, setpoint, 6.0):
            above = place[2] - land.height(place[0], place[1])
            assert above > KEPT - 0.1


@pytest.mark.parametrize("position_setpoints", [True, False])
def test_a_drone_climbs_first_and_then_goes_on(position_setpoints: bool) -> None:  # noqa: FBT001
    """Before a wall it stops and climbs, passes over it with its clearance, and arrives."""
    limits = LIMITS
    guard = SetpointFilter(
        limits,
        np.zeros(3),
        position_setpoints=position_setpoints,
        clearance=clearance(_wall, limits, KEPT),
    )
    vehicle, land = _in_the_air(0.0, 0.0, 8.0), ground(_wall)
    track = _flown(guard, vehicle, PositionSetpoint(np.array([60.0, 0.0, 8.0])), 60.0)
    assert min(p[2] - land.height(p[0], p[1]) for p in track) > KEPT - 0.1
    assert math.dist(track[-1], (60.0, 0.0, 25.0)) < 0.5


def test_higher_ground_than_the_ceiling_is_not_passed() -> None:
    """What cannot be raised is refused: the drone stops before it, below the ceiling."""
    limits = LIMITS.model_copy(update={"geofence": GeofenceConfig(floor=-50.0, ceiling=20.0)})
    guard, vehicle, land = _guard(_wall, limits), _in_the_air(0.0, 0.0, 8.0), ground(_wall)
    for asked in (
        VelocitySetpoint(np.array([5.0, 0.5, 0.0])),
        PositionSetpoint(np.array([60.0, 0.0, 8.0])),
    ):
        track = _flown(guard, vehicle, asked, 30.0)
        assert max(p[2] for p in track) < 20.1
        assert min(p[2] - land.height(p[0], p[1]) for p in track) > KEPT - 0.1
        assert track[-1][0] > 25.0


def test_a_drone_that_is_too_low_climbs_whatever_it_is_asked() -> None:
    """After a gust, say; level flight goes on meanwhile, descent and higher ground do not."""
    guard = _guard(lambda east, north: 0.3 * np.maximum(east, 0.0) + 0.0 * north)
    for velocity in ([0.0, 0.0, 0.0], [0.0, 3.0, -1.0], [3.0, 0.0, 0.0], [-3.0, 0.0, -1.0]):
        odometry = at(0.0, 0.0, 3.0)
        sent = guard.clamp(VelocitySetpoint(np.array(velocity)), odometry, 10.0)
        assert isinstance(sent.setpoint, VelocitySetpoint)
        assert sent.setpoint.velocity[2] > 0.5
        assert sent.setpoint.velocity[0] == pytest.approx(min(velocity[0], 0.0), abs=0.1)
        assert sent.setpoint.velocity[1] == pytest.approx(velocity[1], abs=0.1)
        assert "ground" in sent.clipped_by


def test_the_way_on_which_a_drone_still_is_counts_as_well() -> None:
    """Asked to turn away and to descend, it does not sink into what its velocity leads over."""
    asked = VelocitySetpoint(np.array([0.0, 5.0, -1.5]))
    sent = _guard(_wall).clamp(asked, at(38.0, 0.0, 25.2, velocity=(5.0, 0.0, 0.0)), 10.0)
    assert isinstance(sent.setpoint, VelocitySetpoint)
    assert -0.6 < sent.setpoint.velocity[2] < 0.0


def test_flat_ground_far_below_changes_nothing() -> None:
    """Setpoints are those of a guard without a terrain."""
    plain = SetpointFilter(LIMITS, np.zeros(3))
    guard = _guard(lambda east, north: 0.0 * east * north)
    for asked in (
        VelocitySetpoint(np.array([3.0, 1.0, -1.0])),
        PositionSetpoint(np.array([40.0, -20.0, 12.0])),
    ):
        sent, wanted = (one.clamp(asked, at(0, 0, 30.0), 0.05) for one in (guard, plain))
        assert (sent.setpoint, sent.clipped_by) == (wanted.setpoint, wanted.clipped_by)


def test_a_target_below_the_clearance_is_raised() -> None:
    """And says why."""
    sent = _guard(_wall).clamp(PositionSetpoint(np.array([0.0, 3.0, 1.0])), at(0, 0, 9.0), 0.05)
    assert isinstance(sent.setpoint, PositionSetpoint)
    assert sent.setpoint.position[2] == pytest.approx(KEPT)
    assert "ground" in sent.clipped_by


def test_a_target_out_of_range_and_below_the_clearance_names_both() -> None:
    """What has already changed a target stays named when the ground changes it, too."""
    asked = PositionSetpoint(np.array([200.0, 0.0, 2.0]))
    sent = _guard(_wall).clamp(asked, at(20.0, 0.0, 30.0), 0.05)
    assert {"max_range", "ground"} <= set(sent.clipped_by)


def test_unknown_ground_is_not_flown_over() -> None:
    """At no height: a drone stops before a hole in the terrain, and comes back from within."""
    guard, vehicle = _guard(_hole), _in_the_air(0.0, 0.0, 30.0)
    track = _flown(guard, vehicle, VelocitySetpoint(np.array([5.0, 0.0, 0.0])), 20.0)
    assert 28.0 < max(p[0] for p in track) < 35.0
    inside = guard.clamp(VelocitySetpoint(np.array([-2.0, 0.0, -1.0])), at(40.0, 0.0, 30.0), 10.0)
    assert isinstance(inside.setpoint, VelocitySetpoint)
    np.testing.assert_allclose(inside.setpoint.velocity, [-2.0, 0.0, 0.0], atol=1e-6)


def test_the_way_leads_around_unknown_ground() -> None:
    """A waypoint behind a hole is reached, one within it refused, with the reason."""
    one = flight(
        add(Waypoint("behind", 90, 0, 10), Waypoint("within", 50, 0, 10)),
        limits=LIMITS,
        clearance=clearance(_hole, LIMITS),
    )
    one.run()
    one.expect(S.LANDED)
    assert one.status.visited == ("behind",)
    assert min(math.hypot(p[0] - 50.0, p[1]) for p in one.track) > 14.0
    alerts = [alert.text for alert in one.mission.alerts if alert.kind == "given_up"]
    assert any("over ground that the terrain does not know" in text for text in alerts)


def test_waypoints_below_the_clearance_are_refused() -> None:
    """They could never be reached."""
    one = flight(
        add(Waypoint("low", 60, 0, 22), Waypoint("high", 60, 10, 26)),
        limits=LIMITS,
        clearance=clearance(_wall, LIMITS),
    )
    one.run()
    assert one.status.visited == ("high",)
    (refused,) = [alert.text for alert in one.mission.alerts if alert.kind == "given_up"]
    assert "2.0 m above the ground is less than terrain.clearance 5 m" in refused


@pytest.mark.parametrize("position_setpoints", [True, False])
def test_a_leg_above_ground_follows_it(position_setpoints: bool) -> None:  # noqa: FBT001
    """All the way, not only at its end; a leg above home stays level."""
    land = ground(_swell)
    one = flight(
        add(
            Waypoint("a", 2, 0, 15, above="ground"),
            Waypoint("b", 120, 0, 15, above="ground"),
            Waypoint("c", 0, 0, 40, above="home"),
        ),
        limits=LIMITS,
        vehicle=KinematicVehicle(position_setpoints=position_setpoints),
        clearance=clearance(_swell, LIMITS),
    )
    one.run(until=lambda: "a" in one.status.visited)
    began = len(one.track)
    one.run(until=lambda: "b" in one.status.visited)
    above = [p[2] - land.height(p[0], p[1]) for p in one.track[began:]]
    assert min(above) > 14.6
    assert max(above) < 18.0
    one.run(until=lambda: "c" in one.status.visited)
    assert abs(one.vehicle.position[2] - 40.0) < 0.5
    one.run()
    one.expect(S.LANDED)


def test_the_way_home_leads_over_the_hills_between() -> None:
    """From behind a ridge it climbs before it sets out."""

    def ridge(east: Array, north: Array) -> Array:
        return 30.0 * np.exp(-(((east - 50.0) / 12.0) ** 2)) + 0.0 * north

    one = flight(
        add(Waypoint("over", 50, 0, 40), Waypoint("behind", 100, 0, 8)),
        limits=LIMITS,
        clearance=clearance(ridge, LIMITS),
    )
    one.run(until=lambda: "behind" in one.status.visited)
    one.tell(ReturnHome())
    one.run_to(S.RETURNING)
    began = len(one.track)
    one.run_to(S.LANDING)
    land = ground(ridge)
    track = one.track[began:]
    assert min(p[2] - land.height(p[0], p[1]) for p in track) > KEPT - 0.1
    assert all(p[2] > 34.0 for p in track if p[0] < 40.0)


def test_people_are_told_of_a_drone_too_near_to_the_ground() -> None:
    """It is there by a gust, or because the ground lies otherwise than the vehicle believes."""
    one = flight(add(Waypoint("a", 100, 0, 18)), limits=LIMITS, clearance=clearance(_hills, LIMITS))
    one.run_to(S.ENROUTE)
    one.run(3.0)
    assert not [alert for alert in one.mission.alerts if alert.kind == "ground"]
    east, north, _ = one.vehicle.position
    one.vehicle.position[2] = ground(_hills).height(east, north) + 3.0
    one.run(0.2)
    told = [alert.text for alert in one.mission.alerts if alert.kind == "ground"]
    assert told
    assert "above the ground is less than terrain.clearance 5 m" in told[0]


def test_heights_above_the_sea_are_flown_by_that_of_home() -> None:
    """As the environment or the vehicle gives it, whatever the terrain's own level."""
    one = flight(
        add(Waypoint("a", 47.0002, 8.0, 551.0, waypoint_type="global", above="sea")),
        limits=LIMITS,
        origin=ORIGIN,
        sea_level=539.0,
    )
    one.run(until=lambda: "a" in one.status.visited)
    assert one.vehicle.position[2] == pytest.approx(12.0, abs=0.4)
