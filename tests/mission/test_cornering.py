"""Waypoints that are flown through: where the drone stops all the same, and how fast it turns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flights import PERIOD, KinematicVehicle, add, flight, passed_at
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import EnvironmentConfig, GeofenceConfig, LimitsConfig, RobotConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.drivers.simulated import SimulatedVehicle
from aerodaas.geometry.braking import braking_distance, braking_speed
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.vehicle import PositionSetpoint, Setpoint
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import AddNavigation, Pause, Resume, Start
from aerodaas.mission.loop import SetpointLoop
from aerodaas.mission.mission import Mission
from aerodaas.mission.navigation.cornering import corner_speed, passing_speed
from aerodaas.mission.navigation.planner import InlinePlanner, Plan
from aerodaas.schedulers.trajectory.nearest_neighbor import NearestNeighborScheduler
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler

LIMITS = LimitsConfig(cruise_speed=2.0, arrival_radius=0.5)
ROW = [Waypoint(f"w{number}", 10.0 * number, 0.0, 2.0) for number in range(1, 4)]
"""Three on a straight line."""
EAST = np.array([1.0, 0.0, 0.0])


def way(angle: float) -> Any:  # noqa: ANN401
    """A unit vector, `angle` radians from east."""
    return np.array([math.cos(angle), math.sin(angle), 0.0])


@given(st.floats(0.0, math.pi), st.floats(0.1, 5.0), st.floats(0.5, 6.0), st.floats(0.0, 1.0))
def test_what_is_flown_across_the_next_leg_stops_within_the_arrival_radius(
    angle: float, radius: float, acceleration: float, reaction: float
) -> None:
    """All of it counts where the next leg leads back."""
    limits = LimitsConfig(
        arrival_radius=radius, max_acceleration=acceleration, reaction_time=max(reaction, 1e-3)
    )
    speed = corner_speed(EAST, way(angle), limits)
    across = speed * (math.sin(angle) if angle < math.pi / 2 else 1.0)
    room = braking_distance(across, limits.max_acceleration, limits.reaction_time)
    assert room <= radius * (1 + 1e-6)
    assert speed <= 10.0 * radius
    assert speed >= 0.999 * min(10.0 * radius, braking_speed(radius, acceleration, reaction + 1e-3))


@given(st.floats(0.0, 20.0), st.floats(0.1, 5.0))
def test_a_drone_that_brakes_for_the_waypoint_turns_at_the_speed_of_the_turn(
    turning: float, radius: float
) -> None:
    """At the arrival radius, and never faster."""
    limits = LimitsConfig(arrival_radius=radius)
    a, t = limits.max_acceleration, limits.reaction_time
    there = passing_speed(turning, limits)
    at_radius = braking_speed(radius + braking_distance(there, a, t), a, t)
    assert there <= turning + 1e-9
    assert at_radius == pytest.approx(max(turning, braking_speed(radius, a, t)), abs=1e-6)


def test_a_waypoint_on_a_straight_line_is_flown_through_at_full_speed() -> None:
    """The last one is stopped at."""
    one = flight(add(*ROW), limits=LIMITS)
    assert passed_at(one, "w1") > 1.5
    assert passed_at(one, "w2") > 1.5
    assert passed_at(one, "w3") == 0.0
    assert tuple(one.status.visited) == ("w1", "w2", "w3")


def test_a_drone_stops_where_it_stays() -> None:
    """However short."""
    one = flight(add(ROW[0], replace(ROW[1], hover_duration=0.1), ROW[2]), limits=LIMITS)
    assert passed_at(one, "w1") > 1.5
    assert passed_at(one, "w2") == 0.0


class Stiff(KinematicVehicle):
    """Never turns."""

    def _wanted(self) -> tuple[Any, float]:
        return super()._wanted()[0], 0.0


def test_a_drone_stops_where_it_has_yet_to_turn() -> None:
    """However near it comes."""
    one = flight(add(replace(ROW[0], yaw=1.0), ROW[1]), limits=LIMITS, vehicle=Stiff())
    one.run_to(S.ENROUTE)
    one.run(10.0)
    assert float(np.linalg.norm(one.vehicle.position - ROW[0].position)) < 0.5
    sent = [record.sent for record in one.records if isinstance(record.sent, PositionSetpoint)]
    assert sent
    assert {setpoint.passing_speed for setpoint in sent} == {0.0}


def test_a_yaw_that_it_has_is_no_reason_to_stop() -> None:
    """It looks east already."""
    one = flight(add(*[replace(stop, yaw=0.0) for stop in ROW]), limits=LIMITS)
    assert passed_at(one, "w1") > 1.5


def test_a_plan_that_may_still_change_is_not_anticipated() -> None:
    """The nearest neighbour is chosen anew at each arrival."""
    one = flight(add(*ROW, ordered=False), scheduler=NearestNeighborScheduler(), limits=LIMITS)
    assert passed_at(one, "w1") == 0.0


def test_a_corner_is_turned_at_the_slower_leg_s_speed() -> None:
    """Neither leg is flown faster than it says."""
    slow = [ROW[0], replace(ROW[1], speed=0.7), ROW[2]]
    one = flight(add(*slow), limits=LIMITS)
    assert 0.3 < passed_at(one, "w1") <= 0.7
    assert 0.3 < passed_at(one, "w2") <= 0.7


@pytest.mark.parametrize("back", [False, True])
def test_a_right_angle_and_a_turn_back_are_approached_as_a_stop(back: bool) -> None:  # noqa: FBT001
    """Within the arrival radius the drone can stop from there."""
    corner = Waypoint("back", 1.0, 0.0, 2.0) if back else Waypoint("aside", 10.0, 9.0, 2.0)
    one = flight(add(ROW[0], corner), limits=LIMITS)
    assert passed_at(one, "w1") == pytest.approx(0.0, abs=0.05)


def test_a_waypoint_that_is_missed_in_passing_is_stopped_at() -> None:
    """A vehicle that passes beside it finds it behind, from where the next leg turns back."""

    class Aside(KinematicVehicle):
        def send(self, setpoint: Setpoint) -> Setpoint:
            sent = super().send(setpoint)
            if isinstance(setpoint, PositionSetpoint) and setpoint.passing_speed > 0.0:
                beside = setpoint.position + np.array([0.0, 0.8, 0.0])
                self._setpoint = replace(setpoint, position=beside)
            return sent

    one = flight(add(*ROW), limits=LIMITS, vehicle=Aside())
    one.run(120.0, until=lambda: one.mission.status.visits == 3)
    assert tuple(one.status.visited) == ("w1", "w2", "w3")


def test_what_lies_in_the_same_place_is_not_passed() -> None:
    """There is no direction in which to go on."""
    one = flight(add(ROW[0], replace(ROW[0], id="again"), ROW[1]), limits=LIMITS)
    assert passed_at(one, "w1") == 0.0


def test_a_corner_of_the_fence_is_neither_passed_nor_on_the_line() -> None:
    """On the way around a zone only what is left of the leg may be passed."""
    zone = [(13.0, -2.0), (16.0, -2.0), (16.0, 3.0), (13.0, 3.0)]
    limits = LIMITS.model_copy(update={"geofence": GeofenceConfig(no_fly=[zone], margin=0.5)})
    one = flight(add(*ROW), limits=limits)
    around = 0
    one.run_to(S.ENROUTE)
    while one.status.visits < 2:
        sent = one.turn().sent
        target = one.status.target
        around_zone = isinstance(sent, PositionSetpoint) and abs(sent.position[1]) > 0.1
        if target is not None and target.id == "w2" and around_zone:
            assert isinstance(sent, PositionSetpoint)
            around += 1
            assert sent.passing_speed == 0.0
            assert sent.line_from is None
    assert around > 20


def test_a_stop_that_was_left_for_a_more_urgent_one_begins_no_line() -> None:
    """The drone has not been there."""
    one = flight(add(*ROW), limits=LIMITS)
    one.run_to(S.ENROUTE)
    one.run(2.0)
    one.tell(add(Waypoint("urgent", 0.0, 10.0, 2.0, priority=1)))
    one.run_to(S.DIVERTED)
    sent = one.turn().sent
    assert isinstance(sent, PositionSetpoint)
    assert sent.position.tolist() == [0.0, 10.0, 2.0]
    assert sent.line_from is None


class Slow(InlinePlanner):
    """Answers once it is let."""

    answers = True

    def poll(self) -> Plan | None:
        """The plan, or nothing yet."""
        return super().poll() if self.answers else None


def test_a_plan_that_is_awaited_is_not_anticipated() -> None:
    """What follows is known once it is there."""
    planner = Slow(OrderedScheduler())
    one = flight(add(*ROW), limits=LIMITS, planner=planner)
    one.run_to(S.ENROUTE)
    planner.answers = False
    one.tell(add(Waypoint("w4", 40.0, 0.0, 2.0)))
    assert passed_at(one, "w1") == 0.0
    planner.answers = True
    one.turn()
    assert passed_at(one, "w2") > 1.5


def test_the_line_is_kept_from_where_the_drone_arrived() -> None:
    """Not on the first leg, and not after it has been elsewhere."""
    one = flight(add(*ROW), limits=LIMITS)
    passed_at(one, "w1")
    sent = one.turn().sent
    assert isinstance(sent, PositionSetpoint)
    assert sent.line_from is not None
    assert sent.line_from.tolist() == [10.0, 0.0, 2.0]
    one.tell(Pause())
    one.run_to(S.PAUSED)
    one.run(2.0)
    one.tell(Resume())
    one.run_to(S.ENROUTE)
    sent = one.turn().sent
    assert isinstance(sent, PositionSetpoint)
    assert sent.line_from is None
    first = flight(add(*ROW), limits=LIMITS)
    first.run_to(S.ENROUTE)
    sent = first.turn().sent
    assert isinstance(sent, PositionSetpoint)
    assert sent.line_from is None


def circled(stops: Sequence[Waypoint], limits: LimitsConfig) -> tuple[Mission, list[float]]:
    """Fly the simulated drone along `stops`; its speeds between the first and the last."""
    robot = RobotConfig(id="drone", limits=limits)
    vehicle = SimulatedVehicle(robot, EnvironmentConfig(robots=[robot]))
    vehicle.connect()
    home = vehicle.read().odometry.position
    mission = Mission(robot, InlinePlanner(OrderedScheduler()), takeoff=home)
    loop = SetpointLoop(vehicle, mission)
    mission.handle(AddNavigation(AeroNavigation(data=list(stops))), 0)
    mission.handle(Start(), 0)
    now, speeds = 0, list[float]()
    while mission.status.visits < len(stops) and now < 300 * NANOSECONDS:
        loop.step(now)
        now += PERIOD
        vehicle.advance_to(now)
        if 1 < mission.status.visits < len(stops) - 1:
            speeds.append(float(np.linalg.norm(vehicle.read().odometry.velocity)))
    return mission, speeds


def test_a_simulated_drone_flies_a_circle_without_a_stop() -> None:
    """Of 24 waypoints, 15 degrees between two legs; it came down to half of its speed at each."""
    limits = LimitsConfig(cruise_speed=4.0, arrival_radius=1.0)
    stops = [
        Waypoint(f"p{i}", 40.0 * math.cos(a), 40.0 * math.sin(a), 5.0)
        for i, a in enumerate(np.linspace(0.0, 2 * math.pi, 25))
    ]
    mission, speeds = circled(stops, limits)
    assert mission.status.visits == len(stops)
    assert min(speeds) > 3.4
    assert max(speeds) < 4.4
