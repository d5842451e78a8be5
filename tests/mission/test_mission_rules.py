"""Rules of a mission that combine: each test fails if its rule is taken out."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flights import Flight, KinematicVehicle, Waiting, add, flight, live, square

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import GeofenceConfig, LimitsConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import PositionSetpoint, VehicleMode, VehicleState, VelocitySetpoint
from aerodaas.messages.waypoints import NavigationType, VelocityCommand, Waypoint
from aerodaas.mission.commands import (
    Actuate,
    ClearNavigation,
    Command,
    End,
    HandOver,
    ReleaseParachute,
    ReturnHome,
    StreamItem,
    TakeBack,
)
from aerodaas.mission.navigation.planner import BackgroundPlanner
from aerodaas.mission.navigation.queue import WaypointQueue
from aerodaas.mission.safety.neighbours import Neighbour
from aerodaas.mission.safety.setpoint_filter import SetpointFilter
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler


def alerts(one: Flight, kind: str) -> list[str]:
    """What people were told of this kind."""
    return [alert.text for alert in one.mission.alerts if alert.kind == kind]


def command(speed: float = 1.0) -> StreamItem:
    """A velocity command by stream."""
    item = VelocityCommand(speed, 0.0, 0.0, 0.0)
    return StreamItem("drone/follow", AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [item]))


def test_critical_battery_lands_a_drone_that_is_returning() -> None:
    """Already on the way home, it comes down where it is."""
    one = flight(add(Waypoint("far", 40, 0, 1.5)))
    one.run(25.0)
    one.tell(ReturnHome())
    one.run_to(S.RETURNING)
    one.run(1.0)
    one.vehicle.charge = LimitsConfig().battery_land
    one.run()
    one.expect(S.LANDED)
    assert "critical" in one.status.reason
    assert one.vehicle.position[0] > 10.0


def test_the_way_home_is_never_below_the_lowest_allowed_height() -> None:
    """A drone that is sent home from near the ground climbs first; one above stays above."""
    low = flight(add(Waypoint("low", 20, 0, 0.4)), limits=LimitsConfig(takeoff_height=3.0))
    low.run(until=lambda: "low" in low.status.visited)
    low.tell(ReturnHome())
    low.run_to(S.RETURNING)
    began = len(low.track)
    low.run_to(S.LANDING)
    near_home = [p for p in low.track[began:] if math.hypot(p[0], p[1]) < 5.0]
    assert min(p[2] for p in near_home) > 2.0
    high = flight(add(Waypoint("high", 20, 0, 6.0)), limits=LimitsConfig(takeoff_height=3.0))
    high.run_to(S.RETURNING)
    began = len(high.track)
    high.run_to(S.LANDING)
    assert min(p[2] for p in high.track[began:]) > 5.5


def test_a_wobbling_velocity_does_not_keep_a_drone_beside_home() -> None:
    """An estimator tells 0.8 m/s, to and fro, of a drone that hovers over home: it lands soon."""
    one = flight(add(Waypoint("far", 20, 0, 1.5)))
    one.run_to(S.RETURNING)
    one.run(until=lambda: math.hypot(*one.vehicle.position[:2]) < 1.5)
    one.expect(S.RETURNING)
    read = one.vehicle.read

    def wobbly() -> VehicleState:
        state = read()
        side = 0.8 if state.stamp // (NANOSECONDS // 2) % 2 else -0.8
        moving = state.odometry.velocity + np.array([0.0, side, 0.0])
        return replace(state, odometry=replace(state.odometry, velocity=moving))

    one.vehicle.read = wobbly  # type: ignore[method-assign]
    one.run(8.0)
    assert S.LANDING in one.states
    assert one.status.reason == "all waypoints are visited"


def test_telemetry_that_stands_still_counts_as_loss() -> None:
    """Packets that come with an old stamp tell nothing about now."""
    one = flight(add(*square()))
    one.run(10.0)
    frozen = one.vehicle.read()
    one.vehicle.read = lambda: frozen  # type: ignore[method-assign]
    one.run(2.0)
    one.expect(S.HOLDING)
    assert alerts(one, "link_lost")
    one.run(LimitsConfig().link_timeout)
    one.expect(S.RETURNING)
    assert "no word from the vehicle" in one.status.reason


def test_a_take_off_ends_within_a_tenth_of_its_height() -> None:
    """Of 5 m, and no lower: until then nothing else is flown."""
    one = flight(add(Waypoint("far", 40, 0, 5.0)), limits=LimitsConfig(takeoff_height=5.0))
    one.run(until=lambda: one.mission.state is S.ENROUTE)
    assert one.vehicle.position[2] >= 4.5
    assert abs(one.vehicle.position[0]) < 0.1


@pytest.mark.parametrize("lost", ["lost", "blind"])
def test_two_short_losses_do_not_add_up(lost: str) -> None:
    """Of the link or of the position, each counts from its own beginning."""
    timeout = LimitsConfig().link_timeout
    one = flight(add(Waypoint("far", 60, 0, 1.5)))
    one.run(10.0)
    for _ in range(3):
        setattr(one.vehicle, lost, True)
        one.run(0.7 * timeout)
        one.expect(S.HOLDING)
        setattr(one.vehicle, lost, False)
        one.run(0.5)
        one.expect(S.ENROUTE)


@pytest.mark.parametrize("leave", [None, ReturnHome(), End()])
def test_a_vehicle_that_is_never_heard_again_ends_the_mission(leave: Command | None) -> None:
    """After the time of a return, whether it was on its way out, home or down; people are told."""
    limits = LimitsConfig(return_timeout=60.0)
    one = flight(add(Waypoint("far", 60, 0, 30.0)), limits=limits)
    one.run(40.0)
    if leave is not None:
        one.tell(leave)
    one.turn()
    one.vehicle.lost = True
    began = one.seconds
    one.run(60.0)
    one.expect(S.RETURNING if leave is None or isinstance(leave, ReturnHome) else S.LANDING)
    one.run()
    one.expect(S.ABORTED)
    assert one.seconds - began == pytest.approx(60.0, abs=0.11)
    assert one.status.reason == "the vehicle is lost: no word from it for 60 s"
    assert alerts(one, "vehicle_lost") == [one.status.reason]


def test_a_short_silence_late_in_a_long_descent_does_not_end_the_mission() -> None:
    """What counts is how long nothing was heard, not for how long the drone has been landing."""
    one = flight(add(Waypoint("high", 0, 0, 30.0)), limits=LimitsConfig(return_timeout=10.0))
    one.run(40.0)
    one.tell(End())
    one.run(15.0)
    one.expect(S.LANDING)
    one.vehicle.lost = True
    one.run(2.0)
    one.expect(S.LANDING)
    one.vehicle.lost = False
    one.run()
    one.expect(S.LANDED)


def test_a_lost_link_is_not_a_lost_position() -> None:
    """The first packet after a long silence may tell no place; that alone lands no drone."""
    timeout = LimitsConfig().link_timeout
    one = flight(add(Waypoint("far", 90, 0, 1.5)))
    one.run(80.0)
    one.vehicle.lost = True
    one.run(29.0)
    one.expect(S.RETURNING)
    one.vehicle.lost, one.vehicle.blind = False, True
    one.run(0.5 * timeout)
    one.expect(S.RETURNING)
    one.vehicle.blind = False
    one.run()
    one.expect(S.LANDED)
    assert np.hypot(*one.vehicle.position[:2]) < 1.0


def test_a_position_that_stays_away_lands_the_drone_however_the_link_flickers() -> None:
    """The time without a position adds up until there is one."""
    timeout = LimitsConfig().link_timeout
    one = flight(add(*square()))
    one.run(10.0)
    one.vehicle.blind = True
    one.vehicle.faults = ("GPS: no fix",)
    blind = 0.0
    while one.mission.state is S.HOLDING or blind == 0.0:
        one.run(0.4 * timeout)
        blind += 0.4 * timeout
        one.vehicle.lost = True
        one.run(0.2 * timeout)
        one.vehicle.lost = False
        assert blind < 3 * timeout
    one.expect(S.LANDING)
    assert "GPS: no fix" in one.status.reason
    assert "does not know its position" in one.status.reason


def test_each_fault_of_the_vehicle_is_told_once_by_its_name() -> None:
    """A second one is not hidden by the first; figures that change are no news."""
    one = flight(add(*square()))
    one.run(10.0)
    one.vehicle.faults = ("GPS: no fix",)
    one.run(1.0)
    for number in range(3):
        one.vehicle.faults = ("GPS: no fix", f"estimator: unsure by {number}.5 m")
        one.run(1.0)
    assert alerts(one, "vehicle") == ["GPS: no fix", "estimator: unsure by 0.5 m"]


def test_what_a_vehicle_keeps_refusing_is_not_told_twenty_times_a_second() -> None:
    """Once, and again after ten seconds."""
    one = flight(add(*square()))
    one.run(10.0)
    for _ in range(20 * 25):
        one.mission.vehicle_refused("the order of 12.5 s was replaced")
        one.turn()
    assert len(alerts(one, "refused")) == 3


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_speed_or_a_yaw_rate_that_is_no_number_is_refused(bad: float) -> None:
    """The drone stands still instead, and the guard says why."""
    guard = SetpointFilter(LimitsConfig(), np.zeros(3))
    here = Odometry(np.array([0.0, 0.0, 5.0]), np.zeros(3), 0.0)
    there = np.array([5.0, 0.0, 5.0])
    for setpoint in (
        PositionSetpoint(there, None, bad),
        PositionSetpoint(there, bad),
        VelocitySetpoint(np.array([1.0, 0.0, 0.0]), bad),
    ):
        clamped = guard.clamp(setpoint, here, 0.05)
        assert clamped.clipped_by == ("not_finite",)
        assert isinstance(clamped.setpoint, VelocitySetpoint)
        assert not clamped.setpoint.velocity.any()
        assert clamped.setpoint.yaw_rate == 0.0


@pytest.mark.parametrize("reaction", [0.5, 2.0])
def test_the_fence_is_seen_from_as_far_as_full_speed_needs(reaction: float) -> None:
    """At full speed the drone brakes before a far wall, for it needs all of that way.

    Seen later, the wall would ask at once for a speed that the drone cannot have at once.
    """
    limits = LimitsConfig(
        max_speed=12.0,
        max_acceleration=2.0,
        max_range=500.0,
        reaction_time=reaction,
        geofence=GeofenceConfig(polygon=[(-100, -100), (100, -100), (100, 100), (-100, 100)]),
    )
    guard = SetpointFilter(limits, np.zeros(3))
    asked = VelocitySetpoint(np.array([12.0, 0.0, 0.0]))
    x, speed, step, furthest = 0.0, 12.0, 0.05, 0.0
    sent = [speed] * round(limits.reaction_time / step)
    for _ in range(1000):
        odometry = Odometry(np.array([x, 0.0, 5.0]), np.array([speed, 0.0, 0.0]), 0.0)
        clamped = guard.clamp(asked, odometry, step).setpoint
        assert isinstance(clamped, VelocitySetpoint)
        assert sent[-1] - clamped.velocity[0] <= 2.0 * step + 1e-6
        sent.append(float(clamped.velocity[0]))
        wanted = sent.pop(0)
        speed += float(np.clip(wanted - speed, -2.0 * step, 2.0 * step))
        x += speed * step
        furthest = max(furthest, x)
    assert furthest <= 100.0
    assert furthest > 90.0


def test_each_of_two_drones_takes_half_of_the_room_between_them() -> None:
    """Flying towards each other, neither braking harder than it may, they stay apart by it."""
    limits = LimitsConfig(max_speed=5.0, separation=3.0, max_acceleration=2.0)
    guards = [SetpointFilter(limits, np.zeros(3)) for _ in range(2)]
    x, speeds, step = [-20.0, 20.0], [0.0, 0.0], 0.05
    nearest = math.inf
    for _ in range(800):
        odometries = [
            Odometry(np.array([x[i], 0.0, 5.0]), np.array([speeds[i], 0.0, 0.0]), 0.0)
            for i in range(2)
        ]
        for i, sign in ((0, 1.0), (1, -1.0)):
            other = Neighbour(odometries[1 - i].position, odometries[1 - i].velocity)
            asked = VelocitySetpoint(np.array([5.0 * sign, 0.0, 0.0]))
            sent = guards[i].clamp(asked, odometries[i], step, [other]).setpoint
            assert isinstance(sent, VelocitySetpoint)
            change = float(sent.velocity[0]) - speeds[i]
            speeds[i] += float(np.clip(change, -2.0 * step, 2.0 * step))
        x = [place + speed * step for place, speed in zip(x, speeds, strict=True)]
        nearest = min(nearest, x[1] - x[0])
    assert 3.0 <= nearest < 4.0


class Reversed(OrderedScheduler):
    """Plans the other way round, and leaves the first out."""

    def plan(self, pending: Any, situation: Any) -> Any:  # noqa: ANN401, ARG002
        """Turn the order round."""
        return list(reversed(pending))[:-1]


@pytest.mark.parametrize(
    ("yaw", "told", "velocity"),
    [
        (0.0, (1.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        (0.0, (0.0, 1.0, 0.0), (0.0, 1.0, 0.0)),
        (90.0, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        (90.0, (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)),
        (-90.0, (1.0, 0.0, 0.5), (0.0, -1.0, 0.5)),
        (180.0, (1.0, 1.0, -0.5), (-1.0, -1.0, -0.5)),
    ],
)
def test_a_command_is_by_where_the_nose_points(
    yaw: float, told: tuple[float, float, float], velocity: tuple[float, float, float]
) -> None:
    """Counter-clockwise from east: with the nose north, forward is north and left is west."""
    one = flight(live(), vehicle=KinematicVehicle((0.0, 0.0, 0.0)))
    one.run(10.0)
    one.vehicle.yaw = math.radians(yaw)
    item = VelocityCommand(*told, yaw_rate=0.25)
    one.tell(StreamItem("drone/follow", AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [item])))
    asked = one.turn().asked
    assert isinstance(asked, VelocitySetpoint)
    assert asked.velocity == pytest.approx(velocity, abs=1e-9)
    assert asked.yaw_rate == 0.25


def test_a_command_moves_the_drone_until_it_expires_and_not_then() -> None:
    """Of 0.5 s, the turns at 0 to 0.45 s fly by it; at 0.5 s the drone holds."""
    one = flight(live())
    one.run(10.0)
    item = VelocityCommand(1.0, valid_for=0.5)
    one.tell(StreamItem("drone/follow", AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [item])))
    told = [one.turn().asked for _ in range(11)]
    flown = [isinstance(one, VelocitySetpoint) and one.velocity[0] == 1.0 for one in told]
    assert flown == [True] * 10 + [False]


def test_an_abort_forgets_the_command_of_the_moment() -> None:
    """A velocity command that is still fresh moves the drone no more."""
    one = flight(add(Waypoint("far", 40, 0, 1.5)), live())
    one.run(10.0)
    one.tell(command(2.0))
    one.turn()
    one.tell(ClearNavigation())
    record = one.turn()
    assert not isinstance(record.asked, VelocitySetpoint) or not record.asked.velocity.any()
    one.expect(S.HOLDING)


def test_an_abort_forgets_the_plan_that_is_being_made() -> None:
    """It is not waited for: what is queued next is planned and flown at once."""
    executor = Waiting()
    one = flight(
        add(Waypoint("first", 40, 0, 1.5)),
        planner=BackgroundPlanner(OrderedScheduler(), executor),
    )
    for _ in range(100):
        executor.finish()
        one.turn()
    one.tell(add(Waypoint("second", 9, 0, 1.5), ordered=False))
    one.turn()
    one.tell(ClearNavigation())
    one.tell(add(Waypoint("third", 0, 9, 1.5), index=0))
    one.turn()
    one.expect(S.ENROUTE)
    assert one.status.reason == "flying to third"


def test_a_plan_from_before_a_clear_is_void_with_several_waypoints_left() -> None:
    """Its order and what it gave up mean nothing to waypoints of the same ids."""
    executor = Waiting()
    one = flight(add(*square(), ordered=False), planner=BackgroundPlanner(Reversed(), executor))
    one.turn()
    assert executor.jobs
    again = [Waypoint(f"wp{number}", number, 2, 1.5) for number in (1, 2, 3)]
    one.tell(add(*again, clear_first=True, ordered=False))
    jobs = executor.jobs
    executor.jobs = []
    for future, job in jobs:
        future.set_result(job())
    one.turn()
    assert [waypoint.id for waypoint in one.status.pending] == ["wp1", "wp2", "wp3"]
    assert not one.status.given_up


def test_a_target_that_moves_stays_under_way() -> None:
    """The drone has set out for it, wherever it is now: an urgent stop interrupts it."""
    queue = WaypointQueue()
    queue.add([Waypoint("person", 5, 0, 2)], source="follow")
    assert queue.head is not None
    queue.head.under_way = True
    queue.add([Waypoint("person", 7, 0, 2)], source="follow")
    assert queue.head.under_way
    assert queue.head.waypoint.x == 7
    queue.add([Waypoint("urgent", 0, 0, 2, priority=1)])
    assert queue.interrupted


def test_ties_keep_their_order() -> None:
    """Equal priorities are served in the order in which they came, in and out of groups."""
    queue = WaypointQueue()
    for name in ("b", "a", "d", "c"):
        queue.add([Waypoint(name, 0, 0, 1)])
    queue.add([Waypoint("urgent", 0, 0, 1, priority=1)])
    queue.add([Waypoint("e", 0, 0, 1)])
    assert [stop.id for stop in queue] == ["urgent", "b", "a", "d", "c", "e"]


@pytest.mark.parametrize("index", [2, 3, 2**63, 18446744073709551615])
def test_an_index_beyond_the_queue_is_its_end(index: int) -> None:
    """However large; an empty list of a priority is never left behind."""
    queue = WaypointQueue()
    queue.add([Waypoint("a", 0, 0, 1)])
    queue.add([Waypoint("b", 0, 0, 1), Waypoint("c", 0, 0, 1)], index=index)
    queue.add([Waypoint("d", 0, 0, 1, priority=1)], index=index)
    assert [stop.id for stop in queue] == ["d", "a", "b", "c"]
    for name in "dabc":
        assert queue.head is not None
        assert queue.head.id == name
        queue.remove(name)
    assert queue.head is None


def test_a_forecast_that_is_short_for_a_moment_only_is_not_told() -> None:
    """A plan that is changed at once; one that stays too long is told, once, as what it is."""
    limits = LimitsConfig(endurance=600.0, battery_return=0.15, battery_land=0.1)
    far = Waypoint("far", 90, 0, 1.5)
    one = flight(live(), limits=limits, vehicle=KinematicVehicle(charge=0.33))
    one.run(10.0)
    one.tell(add(far))
    one.run(5.0)
    one.tell(ClearNavigation())
    one.run(10.0)
    assert not alerts(one, "unreachable_plan")
    one.tell(add(far))
    one.run(15.0)
    told = alerts(one, "unreachable_plan")
    assert len(told) == 1
    assert "at this rate" in told[0]
    assert any("at this rate" in fault for fault in one.status.faults)


def test_a_forecast_is_told_for_as_long_as_it_is_made() -> None:
    """A drone that comes home, or has, does not still have a plan that is too long."""
    limits = LimitsConfig(endurance=600.0, battery_return=0.15, battery_land=0.1)
    one = flight(live(), limits=limits, vehicle=KinematicVehicle(charge=0.33))
    one.run(10.0)
    one.tell(add(Waypoint("far", 90, 0, 1.5)))
    one.run(2.0)
    assert any("at this rate" in fault for fault in one.status.faults)
    one.tell(End("enough"))
    one.run(4.0)
    assert one.status.state in {S.LANDING, S.LANDED}
    assert not one.status.faults
    one.run_to(S.LANDED)
    assert not one.status.faults


def forecast_of(waypoint: Waypoint, charge: float) -> list[str]:
    """What is told before take-off of a plan of this one waypoint."""
    limits = LimitsConfig(endurance=600.0, battery_return=0.15, battery_land=0.1)
    one = flight(add(waypoint), limits=limits, vehicle=KinematicVehicle(charge=charge))
    one.turn()
    return alerts(one, "unreachable_plan")


def test_the_forecast_counts_what_will_be_flown() -> None:
    """No faster than the drone may fly, and with room for what gauge and model do not know."""
    slow = Waypoint("far", 20, 0, 1.5, speed=LimitsConfig().max_speed)
    fast = Waypoint("far", 20, 0, 1.5, speed=200.0)
    for charge in (0.16, 0.2, 0.3, 1.0):
        assert forecast_of(fast, charge) == forecast_of(slow, charge)
    hover = Waypoint("here", 0, 0, 0.5, hover_duration=0.5 * 600)
    assert not forecast_of(hover, 0.58)
    assert forecast_of(hover, 0.5)
    absurd = forecast_of(Waypoint("here", 0, 0, 0.5, hover_duration=1e9), 1.0)
    assert "more than 999%" in absurd[0]


def test_a_hover_that_is_nearly_over_is_not_forecast_anew() -> None:
    """Half way through it the battery lasts, for half of it is left."""
    limits = LimitsConfig(endurance=300.0, battery_return=0.15, battery_land=0.1)
    here = Waypoint("here", 0, 0, 1.5, hover_duration=150.0)
    vehicle = KinematicVehicle(drain=1 / 300.0, charge=0.7)
    one = flight(add(here), limits=limits, vehicle=vehicle)
    one.run()
    assert one.status.visited == ("here",)
    assert not alerts(one, "unreachable_plan")


class Nasty:
    """An item of a stream that raises whatever is asked of it."""

    def __len__(self) -> int:
        raise OSError("no length")


def test_what_a_command_raises_is_its_own_failure() -> None:
    """It is refused, people are told, and the mission flies on."""
    one = flight(add(*square()), live())
    one.run(10.0)
    answer = one.tell(StreamItem("drone/follow", Nasty()))
    assert not answer.accepted
    assert "no length" in answer.text
    assert alerts(one, "command_failed") == [answer.text]
    one.run()
    one.expect(S.LANDED)
    assert len(one.status.visited) == 4
    assert one.vehicle.mode is VehicleMode.GROUNDED
    assert one.now > NANOSECONDS


@pytest.mark.parametrize(
    "asked", [HandOver(), TakeBack(), Actuate("hook", "release"), ReleaseParachute("chute")]
)
def test_a_command_of_an_extension_that_is_absent_is_refused(
    monkeypatch: pytest.MonkeyPatch, asked: Command
) -> None:
    """The mission flies on."""
    monkeypatch.setattr("aerodaas.mission.handover.added", lambda _: [])
    monkeypatch.setattr("aerodaas.mission.action_executor.added", lambda _: [])
    one = flight(add(Waypoint("a", 5, 0, 2)))
    one.run_to(S.ENROUTE)
    answer = one.tell(asked)
    assert not answer.accepted
    assert "this installation" in answer.text
    one.run()
    one.expect(S.LANDED)
    assert tuple(one.status.visited) == ("a",)
