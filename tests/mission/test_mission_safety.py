"""Whatever happens to the vehicle or the application, the drone ends up safe and says why."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from flights import KinematicVehicle, Waiting, add, flight, live, navigation, square

from aerodaas.config.model import GeofenceConfig, LimitsConfig, MissionConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import VehicleError
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.messages.waypoints import NavigationType, VelocityCommand, Waypoint
from aerodaas.mission.commands import (
    End,
    OpenStream,
    Pause,
    Resume,
    ReturnHome,
    StreamItem,
)
from aerodaas.mission.navigation.planner import BackgroundPlanner
from aerodaas.schedulers.trajectory.base import PlanningContext, TrajectoryScheduler
from aerodaas.schedulers.trajectory.nearest_neighbor import NearestNeighborScheduler

FENCE = LimitsConfig(
    geofence=GeofenceConfig(polygon=[(-5, -5), (25, -5), (25, 25), (-5, 25)], ceiling=10.0)
)


def test_low_battery_returns_and_critical_lands() -> None:
    """The drone comes home on what is left; where that is impossible it lands on the spot."""
    low = flight(add(Waypoint("far", 40, 0, 1.5)), vehicle=KinematicVehicle(drain=0.02))
    low.run()
    low.expect(S.LANDED)
    assert not low.status.visited
    assert "battery" in low.status.reason
    assert S.RETURNING in low.states
    assert np.linalg.norm(low.vehicle.position) < 0.5
    assert low.vehicle.charge > LimitsConfig().battery_land
    assert "battery_low" in [alert.kind for alert in low.mission.alerts]

    critical = flight(add(Waypoint("far", 40, 0, 1.5)))
    critical.run(10.0)
    critical.vehicle.charge = 0.1
    critical.run()
    critical.expect(S.LANDED)
    assert critical.vehicle.position[0] > 3.0
    assert critical.states[-2] is S.LANDING


def test_a_drone_that_flies_past_home_does_not_land_there() -> None:
    """It comes back and stands still above its place first, however wide the arrival."""
    limits = LimitsConfig(arrival_radius=2.0, cruise_speed=4.0, max_speed=5.0)
    fast = flight(add(Waypoint("far", 20, 0, 1.5)), limits=limits)
    fast.run_to(S.LANDING)
    assert math.hypot(*fast.vehicle.velocity[:2]) <= 0.5
    fast.run()
    fast.expect(S.LANDED)
    assert math.hypot(*fast.vehicle.position[:2]) < 1.0


def test_return_is_earlier_where_home_is_far() -> None:
    """The charge at which the drone turns back grows with the way home."""
    limits = LimitsConfig(endurance=100.0, battery_return=0.2, battery_land=0.1)
    vehicle = KinematicVehicle(drain=0.01)
    far = flight(add(Waypoint("far", 90, 0, 1.5)), limits=limits, vehicle=vehicle)
    far.run_to(S.RETURNING)
    assert far.vehicle.charge > 0.45
    assert "way home" in far.status.reason
    far.run()
    assert np.linalg.norm(far.vehicle.position) < 0.5
    assert far.vehicle.charge > 0.1


def test_a_pilot_who_takes_over_is_left_alone() -> None:
    """Nothing is sent any more, and the mission says so."""
    taken = flight(add(*square()))
    taken.run(10.0)
    taken.vehicle.mode = VehicleMode.MANUAL
    sent = len(taken.vehicle.sent)
    for _ in range(45):
        taken.turn()
    taken.expect(S.ABORTED)
    assert taken.status.reason == "a pilot has taken over"
    assert len(taken.vehicle.sent) == sent
    assert taken.vehicle.calls == ["take_off"]


def test_a_short_loss_of_the_link_is_waited_out_and_a_long_one_ends_the_flight() -> None:
    """The vehicle is told to return as soon as it can hear again."""
    lost = flight(add(*square()))
    lost.run(10.0)
    lost.vehicle.lost = True
    lost.run(2.0)
    lost.expect(S.HOLDING)
    lost.vehicle.lost = False
    lost.run(1.0)
    lost.expect(S.ENROUTE)
    lost.vehicle.lost = True
    lost.run(4.0)
    lost.expect(S.RETURNING)
    assert "return_home" in lost.vehicle.calls
    lost.vehicle.lost = False
    lost.run()
    lost.expect(S.LANDED)
    assert "link_lost" in [alert.kind for alert in lost.mission.alerts]


def test_a_vehicle_that_raises_counts_as_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """An exception of the driver does not stop the loop."""
    broken = flight(add(*square()))
    broken.run(10.0)

    def read() -> None:
        raise VehicleError("socket closed")

    monkeypatch.setattr(broken.vehicle, "read", read)
    broken.run(5.0)
    broken.expect(S.RETURNING)


def test_a_vehicle_without_position_stands_still_and_lands() -> None:
    """No setpoint moves it, and after a while it lands."""
    blind = flight(add(*square()))
    blind.run(10.0)
    blind.vehicle.blind = True
    record = blind.turn()
    assert record.sent is not None
    blind.run(4.0)
    assert S.LANDING in blind.states
    assert "position" in blind.status.reason


def test_take_off_is_refused_with_all_reasons() -> None:
    """Battery, fence and height are named at once, by their settings; nothing leaves the ground."""
    limits = FENCE.model_copy(update={"takeoff_height": 9.0})
    vehicle = KinematicVehicle((50.0, 0.0, 11.0), charge=0.2)
    refused = flight(
        add(Waypoint("a", 0, 0, 5, waypoint_type="local")), limits=limits, vehicle=vehicle
    )
    refused.run()
    refused.expect(S.ABORTED)
    for word in ("battery is at 20%", "outside its geofence", "20 m leaves"):
        assert word in refused.status.reason
    for setting in ("limits.geofence", "limits.battery_return", "limits.takeoff_height"):
        assert setting in refused.status.reason
    assert not vehicle.calls


def test_nothing_to_fly_is_refused() -> None:
    """Without waypoints and streams there is no reason to take off, and the reason is told."""
    empty = flight()
    empty.run()
    empty.expect(S.ABORTED)
    outside = flight(add(Waypoint("out", 99, 0, 1.5)), limits=FENCE)
    outside.run()
    assert "outside the geofence" in outside.status.reason


@pytest.mark.parametrize(
    ("waypoint", "word", "setting"),
    [
        (Waypoint("w", 99, 0, 2), "outside the geofence", "(limits.geofence)"),
        (Waypoint("w", 24.8, 0, 2), "within 0.5 m", "(limits.geofence.margin)"),
        (Waypoint("w", 0, 0, 0.1), "under the floor", "(limits.geofence.floor)"),
        (Waypoint("w", 0, 0, 11), "above the ceiling", "(limits.geofence.ceiling)"),
        (Waypoint("w", 1, 1, 2, deadline=0.5), "is past", ""),
        (Waypoint("wp2", 1, 1, 2), "already queued", ""),
        (Waypoint("w", 48.1, 11.5, 500, waypoint_type="global"), "gives no home", ""),
        (Waypoint("w", 0, 5000, 2), "beyond the range", "(limits.max_range)"),
    ],
)
def test_bad_waypoints_are_answered_and_the_flight_goes_on(
    waypoint: Waypoint, word: str, setting: str
) -> None:
    """Each gets its reason and the setting that may permit it; good ones of the same are flown."""
    survey = flight(add(*square()), limits=LimitsConfig() if waypoint.y > 1000 else FENCE)
    survey.run(8.0)
    answer = survey.tell(add(waypoint, Waypoint("good", 5, 5, 2)))
    assert word in answer.refused[waypoint.id]
    assert setting in answer.refused[waypoint.id]
    assert answer.accepted
    survey.run()
    survey.expect(S.LANDED)
    assert "good" in survey.status.visited
    assert (waypoint.id in survey.status.given_up) is (waypoint.id not in survey.status.visited)


def test_global_waypoints_need_a_home() -> None:
    """With one, they are flown to."""
    origin = GeodeticOrigin(48.1, 11.5, 500.0)
    latitude, longitude, altitude = origin.to_geodetic(np.array([6.0, 3.0, 2.0]))
    survey = flight(add(Waypoint("g", latitude, longitude, altitude, 2.0, "global")), origin=origin)
    survey.run_to(S.LOITERING)
    assert survey.vehicle.position == pytest.approx([6, 3, 2], abs=0.4)


def test_pause_hovers_and_resume_goes_on() -> None:
    """The drone stays where it stopped and then flies to the same waypoint."""
    survey = flight(add(*square()))
    survey.run(until=lambda: "wp2" in survey.status.visited)
    survey.run(2.0)
    survey.tell(Pause())
    survey.run(3.0)
    survey.expect(S.PAUSED)
    stood = survey.vehicle.position.copy()
    survey.run(10.0)
    assert np.linalg.norm(survey.vehicle.position - stood) < 0.2
    assert survey.tell(Resume()).accepted
    survey.run()
    assert survey.status.visited == ("wp1", "wp2", "wp3", "wp4")


@pytest.mark.parametrize(("command", "at_home"), [(End(), False), (ReturnHome(), True)])
def test_end_lands_here_and_return_lands_at_home(command: End | ReturnHome, at_home: bool) -> None:  # noqa: FBT001
    """Both end the mission on the ground."""
    survey = flight(add(*square()[1:]))
    survey.run(8.0)
    survey.tell(command)
    survey.run()
    survey.expect(S.LANDED)
    distance = math.hypot(survey.vehicle.position[0], survey.vehicle.position[1])
    assert at_home == (distance < 0.5)
    assert "asked" in survey.status.reason


@pytest.mark.parametrize(("on_complete", "state"), [("land", S.LANDED), ("hold", S.HOLDING)])
def test_what_follows_the_last_waypoint(on_complete: Any, state: S) -> None:  # noqa: ANN401
    """Land on the spot, or hold for what a remote user may add."""
    survey = flight(add(Waypoint("a", 5, 0, 1.5)), options=MissionConfig(on_complete=on_complete))
    survey.run(40.0)
    survey.expect(state)
    assert survey.vehicle.position[0] == pytest.approx(5.0, abs=0.4)


FIELD = [(-5.0, -5.0), (25.0, -5.0), (25.0, 25.0), (-5.0, 25.0)]


def test_obstacles_are_flown_around_there_and_back() -> None:
    """A no-fly zone between the drone, its waypoint and home costs a detour, nothing else."""
    zone = [(4.0, -5.0), (6.0, -5.0), (6.0, 20.0), (4.0, 20.0)]
    around = LimitsConfig(geofence=GeofenceConfig(polygon=FIELD, no_fly=[zone]), cruise_speed=2.0)
    survey = flight(add(Waypoint("behind", 10, 0, 1.5)), limits=around)
    survey.run()
    survey.expect(S.LANDED)
    assert survey.status.visited == ("behind",)
    assert np.linalg.norm(survey.vehicle.position) < 0.5
    assert 80.0 < survey.status.distance < 95.0
    assert not any(3.6 < p[0] < 6.4 and p[1] < 20.4 for p in survey.track)


def test_a_waypoint_that_cannot_be_reached_is_given_up() -> None:
    """A wall without a gap costs the waypoint behind it, not the mission."""
    wall = [(4.0, -6.0), (6.0, -6.0), (6.0, 26.0), (4.0, 26.0)]
    divided = LimitsConfig(geofence=GeofenceConfig(polygon=FIELD, no_fly=[wall]))
    blocked = flight(
        add(Waypoint("behind", 10, 0, 1.5), Waypoint("here", 1, 1, 1.5)), limits=divided
    )
    blocked.run()
    blocked.expect(S.LANDED)
    assert blocked.status.visited == ("here",)
    assert blocked.status.given_up == ("behind",)
    assert max(position[0] for position in blocked.track) < 3.6


def test_a_drone_that_comes_no_nearer_gives_up() -> None:
    """A headwind that cannot be beaten costs the stall time-out, not the mission."""
    vehicle = KinematicVehicle(wind=(-1.0, 0.0, 0.0))
    windy = flight(
        add(Waypoint("upwind", 10, 0, 1.5)),
        vehicle=vehicle,
        options=MissionConfig(stall_timeout=5.0),
    )
    windy.run_to(S.RETURNING)
    assert windy.status.given_up == ("upwind",)


def test_a_plan_that_the_battery_cannot_fly_is_announced() -> None:
    """Before take-off, not when it is too late."""
    long = flight(add(Waypoint("far", 400, 0, 1.5)), limits=LimitsConfig(endurance=300.0))
    long.turn()
    assert "unreachable_plan" in [alert.kind for alert in long.mission.alerts]
    assert "way home need" in long.status.faults[-1]


def test_more_urgent_commands_win_and_priorities_of_streams_override() -> None:
    """A stream's own priority replaces that of its items; the less urgent of two is ignored."""
    both = flight(OpenStream("low", priority=7), OpenStream("high", priority=1))
    both.run_to(S.HOLDING)

    def say(stream: str, command: VelocityCommand) -> StreamItem:
        nav = AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [command])
        return StreamItem(stream, nav, Header(3, both.now, "drone/cam"))

    for _ in range(60):
        both.tell(say("high", VelocityCommand(forward=1.0)))
        both.tell(say("low", VelocityCommand(left=1.0)))
        both.turn()
    assert both.vehicle.position[0] > 2.0
    assert abs(both.vehicle.position[1]) < 0.1
    last = both.records[-1]
    assert last.cause == Header(3, last.stamp, "drone/cam")


class _Backwards(TrajectoryScheduler):
    def plan(self, pending: Sequence[Waypoint], situation: PlanningContext) -> Sequence[Waypoint]:  # noqa: ARG002
        return list(reversed(pending))


def test_a_slow_plan_delays_no_setpoint() -> None:
    """While a re-plan is made the drone flies on; the plan counts once it is there."""
    executor = Waiting()
    survey = flight(
        add(*square()[1:3], ordered=False),
        planner=BackgroundPlanner(_Backwards(), executor),
        options=MissionConfig(plan_timeout=3.0),
    )
    survey.run_to(S.HOLDING)
    assert survey.status.reason == "waiting for a plan"
    executor.finish()
    survey.run_to(S.ENROUTE)
    assert survey.status.reason == "flying to wp3"
    survey.tell(add(Waypoint("new", 0, 5, 1.5), ordered=False))
    for _ in range(20):
        assert survey.turn().sent is not None
    assert survey.status.reason == "flying to wp3"
    executor.finish()
    survey.turn()
    assert survey.status.reason == "flying to new"


def test_a_plan_that_never_comes_is_not_waited_for() -> None:
    """After the time-out the order given is flown."""
    options = MissionConfig(plan_timeout=2.0)
    survey = flight(
        add(*square()), planner=BackgroundPlanner(_Backwards(), Waiting()), options=options
    )
    survey.run()
    survey.expect(S.LANDED)
    assert survey.status.visited == ("wp1", "wp2", "wp3", "wp4")


def test_same_flight_twice_is_the_same_to_the_last_digit() -> None:
    """Nothing in the loop depends on the host."""
    tracks = []
    for _ in range(2):
        survey = flight(add(*square(), ordered=False), scheduler=NearestNeighborScheduler())
        survey.run()
        tracks.append(np.array(survey.track))
    assert np.array_equal(tracks[0], tracks[1])


def test_velocity_setpoint_only_vehicles_fly_the_same_mission() -> None:
    """A vehicle that takes no places gets velocities towards them, and stays in its limits."""
    vehicle = KinematicVehicle(position_setpoints=False)
    survey = flight(add(*square(hover=1.0)), live(), vehicle=vehicle)
    survey.tell(StreamItem("drone/follow", navigation([Waypoint("extra", 5, 5, 2)])))
    survey.run()
    survey.expect(S.LANDED)
    assert len(survey.status.visited) == 5
    assert math.hypot(vehicle.position[0], vehicle.position[1]) < 0.5
