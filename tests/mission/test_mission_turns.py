"""Turns of a mission at the edge of its rules: what is planned, told, counted and flown."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from flights import PERIOD, KinematicVehicle, add, flight, live, square

from aerodaas.config.model import GeofenceConfig, LimitsConfig, MissionConfig, RobotConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import VehicleError
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.vehicle import PositionSetpoint, VehicleMode, VelocitySetpoint
from aerodaas.messages.waypoints import NavigationType, VelocityCommand, Waypoint
from aerodaas.mission.commands import (
    Answer,
    End,
    Pause,
    Resume,
    ReturnHome,
    Start,
    StreamItem,
)
from aerodaas.mission.mission import Mission
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.schedulers.trajectory.base import PlanningContext, TrajectoryScheduler


class Asked(TrajectoryScheduler):
    """Keeps what it is asked."""

    isolated = False

    def __init__(self) -> None:
        super().__init__()
        self.situations: list[PlanningContext] = []

    def plan(self, pending: Sequence[Waypoint], situation: PlanningContext) -> Sequence[Waypoint]:
        """Keep the order."""
        self.situations.append(situation)
        return pending


def command(speed: float = 1.0, valid_for: float = 0.5, priority: int = 0) -> StreamItem:
    """A velocity command by stream."""
    item = VelocityCommand(speed, valid_for=valid_for, priority=priority)
    return StreamItem("drone/follow", AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [item]))


def test_a_scheduler_is_told_all_that_it_plans_by() -> None:
    """Time, place, home, battery, speed, the energy model and the reserve, all of this flight."""
    asked = Asked()
    limits = LimitsConfig(cruise_speed=2.5, battery_land=0.15, endurance=432.0)
    vehicle = KinematicVehicle((3.0, -7.0, 1.0), charge=0.8)
    one = flight(add(*square()), scheduler=asked, limits=limits, vehicle=vehicle)
    one.run(6.0)
    one.tell(add(Waypoint("later", 5, 5, 1.5)))
    one.turn()
    first, later = asked.situations[0], asked.situations[-1]
    assert first.now == 0.0
    assert first.position.tolist() == first.home.tolist() == [3.0, -7.0, 1.0]
    assert later.now == pytest.approx(6.0)
    assert later.position[2] > 2.0
    for situation in (first, later):
        assert situation.home.tolist() == [3.0, -7.0, 1.0]
        assert situation.speed == 2.5
        assert situation.battery == 0.8
        assert situation.reserve == 0.15
        assert situation.energy is not None
        assert situation.energy.endurance == 432.0


@pytest.mark.parametrize("home", [(3.0, -7.0, 0.0), (-4.0, 9.0, 2.0)])
def test_home_is_where_the_drone_took_off(home: tuple[float, float, float]) -> None:
    """It comes back over that place, at its height, and lands on it."""
    one = flight(add(Waypoint("far", 8, 3, 2.0)), vehicle=KinematicVehicle(home))
    one.run()
    one.expect(S.LANDED)
    assert one.status.visited == ("far",)
    assert one.vehicle.position == pytest.approx(home, abs=0.4)


@pytest.mark.parametrize(
    ("on_complete", "last"), [("land", S.LANDING), ("hold", S.HOLDING), ("return", S.RETURNING)]
)
def test_a_flight_that_is_complete_says_so(on_complete: str, last: S) -> None:
    """Whatever follows, the reason for it is the plan's end."""
    options = MissionConfig.model_validate({"on_complete": on_complete})
    one = flight(add(Waypoint("a", 5, 0, 1.5)), options=options)
    one.run(until=lambda: bool(one.status.visited))
    one.expect(last)
    assert one.status.reason == "all waypoints are visited"


def test_what_is_carried_before_take_off_is_not_flown() -> None:
    """The distance counts from the air, and a position that was lost leaves no gap in it."""
    one = flight(add(Waypoint("far", 10, 0, 1.5)))
    one.vehicle.objections = ["not yet"]
    one.run(1.0)
    one.vehicle.position[0] = -3.0
    one.run(1.0)
    one.vehicle.position[0] = 0.0
    one.vehicle.objections = []
    one.run_to(S.ENROUTE)
    assert one.status.distance < 2.0
    one.vehicle.blind = True
    one.run(1.0)
    one.vehicle.blind = False
    one.run_to(S.LANDED)
    assert one.status.distance == pytest.approx(1.5 + 10 + 10 + 1.5, abs=2.0)


def test_a_battery_that_drains_on_the_ground_says_nothing_of_the_flight() -> None:
    """Waiting with the computer on does not make the way home look dear."""
    vehicle = KinematicVehicle()
    one = flight(add(Waypoint("far", 20, 0, 1.5)), vehicle=vehicle)
    vehicle.objections = ["not yet"]
    for charge in (1.0, 0.9, 0.8, 0.7):
        vehicle.charge = charge
        one.run(1.0)
    vehicle.objections = []
    one.run()
    one.expect(S.LANDED)
    assert one.status.visited == ("far",)
    assert not [alert for alert in one.mission.alerts if alert.kind == "battery_low"]


def test_a_hover_that_is_interrupted_goes_on_and_the_reason_with_it() -> None:
    """Hovering, held, under way again: the state and its reason say which at each turn."""
    one = flight(add(Waypoint("a", 5, 0, 1.5, 10.0), Waypoint("b", 9, 0, 1.5)))
    one.run_to(S.LOITERING)
    assert one.status.reason == "at a"
    one.run(4.0)
    one.tell(Pause())
    one.turn()
    one.expect(S.PAUSED)
    one.run(3.0)
    one.tell(Resume())
    one.turn()
    assert one.status.reason in {"flying to a", "at a"}
    began = one.seconds
    one.run(until=lambda: "a" in one.status.visited)
    assert one.seconds - began == pytest.approx(6.0, abs=0.3)
    one.turn()
    assert one.status.reason == "flying to b"


@pytest.mark.parametrize("when", [S.TAKING_OFF, S.HOLDING, S.FOLLOWING])
def test_a_pause_stops_the_drone_in_every_state(when: S) -> None:
    """On the way up it counts once the drone is up; a resumed one waits for navigation anew."""
    limits = LimitsConfig(command_timeout=1.0, silence_return=4.0)
    one = flight(live(), limits=limits)
    one.run_to(S.TAKING_OFF if when is S.TAKING_OFF else S.HOLDING)
    if when is S.FOLLOWING:
        one.tell(command())
        one.turn()
    one.expect(when)
    assert one.tell(Pause()).accepted
    one.run(30.0)
    one.expect(S.PAUSED)
    resumed = one.seconds
    assert one.tell(Resume()).accepted
    one.expect(S.HOLDING)
    assert one.tell(Resume()).accepted is False
    one.run(until=lambda: one.mission.state in {S.RETURNING, S.LANDING})
    assert one.seconds - resumed == pytest.approx(5.0, abs=0.2)


def test_a_failsafe_goes_before_a_pause() -> None:
    """A paused drone whose battery is low returns, and lands where it is critical."""
    for charge, state in ((0.2, S.RETURNING), (0.1, S.LANDING)):
        one = flight(add(Waypoint("far", 30, 0, 1.5)))
        one.run(12.0)
        one.tell(Pause())
        one.run(1.0)
        one.vehicle.charge = charge
        one.turn()
        one.expect(state)
        assert one.tell(Resume()).accepted or state is S.LANDING
        one.run(1.0)
        one.expect(state)


def test_a_lost_link_and_a_low_battery_at_once() -> None:
    """The drone that cannot be heard is told to come home; one that is nearly empty to land."""
    for charge, state, called in ((0.2, S.RETURNING, "return_home"), (0.05, S.LANDING, "land")):
        one = flight(add(Waypoint("far", 30, 0, 1.5)))
        one.run(12.0)
        one.vehicle.lost, one.vehicle.charge = True, charge
        one.turn()
        one.expect(state)
        one.run(4.0)
        one.expect(state)
        assert called in one.vehicle.calls
        assert {"link_lost"} < {alert.kind for alert in one.mission.alerts}


def test_a_return_without_a_position_is_left_to_the_vehicle() -> None:
    """Its own return needs no setpoints of ours, and ours would be made of nothing."""
    one = flight(add(Waypoint("far", 30, 0, 1.5)))
    one.run(12.0)
    one.tell(ReturnHome())
    one.run(1.0)
    one.vehicle.blind = True
    sent = len(one.vehicle.sent)
    one.turn()
    assert one.vehicle.calls[-1] == "return_home"
    assert len(one.vehicle.sent) == sent


def test_a_return_that_takes_too_long_ends_in_a_landing() -> None:
    """Beyond its time, not at it; the reason says both why it returned and why it lands."""
    limits = LimitsConfig(return_timeout=5.0)
    one = flight(add(Waypoint("far", 40, 0, 1.5)), limits=limits)
    one.run(30.0)
    one.tell(ReturnHome("enough"))
    one.turn()
    began = one.now - PERIOD
    one.run_to(S.LANDING)
    assert one.now - PERIOD - began == round(5.05 * 1e9)
    assert one.status.reason == "the return took too long; enough"


def test_a_take_off_that_takes_too_long_ends_in_a_landing() -> None:
    """Beyond its time, not at it."""
    limits = LimitsConfig(takeoff_height=10.0, takeoff_timeout=4.0)
    one = flight(add(*square(height=10.0)), limits=limits)
    one.vehicle.objections = ["not yet"]
    one.run(2.0)
    one.vehicle.objections = []
    one.run_to(S.TAKING_OFF)
    began = one.now - PERIOD
    one.run_to(S.LANDING)
    assert one.now - PERIOD - began == round(4.05 * 1e9)
    assert one.status.reason == "the take-off took too long"


def test_objections_are_waited_for_just_as_long_as_is_said() -> None:
    """At the time-out the take-off is refused, a turn before it is not."""
    one = flight(add(*square()), limits=LimitsConfig(preflight_timeout=2.0))
    one.vehicle.objections = ["no fix", "no compass"]
    one.run()
    one.expect(S.ABORTED)
    assert one.now - PERIOD == 2_000_000_000
    assert one.status.reason == "take-off refused: no fix; no compass"
    assert [alert.kind for alert in one.mission.alerts] == ["takeoff_refused"]


def test_an_end_before_take_off_ends_the_mission_on_the_ground() -> None:
    """Idle or waiting, no motor starts."""
    for start in (False, True):
        one = flight(add(*square()), start=start)
        one.vehicle.objections = ["not yet"]
        one.turn()
        assert one.tell(End("no need")).accepted
        one.expect(S.ABORTED)
        assert one.status.reason == "no need before take-off"
        one.vehicle.objections = []
        one.turn()
        assert not one.vehicle.calls


def test_silence_ends_in_a_return_beyond_its_time() -> None:
    """At the sum of both time-outs the drone still holds; the turn after, it returns."""
    limits = LimitsConfig(command_timeout=1.0, silence_return=4.0)
    one = flight(live(), limits=limits)
    one.run_to(S.HOLDING)
    one.tell(command())
    heard = one.now
    one.run(until=lambda: one.mission.state in {S.RETURNING, S.LANDING})
    assert one.now - PERIOD - heard == round(5.05 * 1e9)
    assert one.status.reason == "navigation has been silent for 5 s"


def test_a_command_over_a_plan_diverts_and_one_alone_is_followed() -> None:
    """What waits decides the state, while the command lives and for a moment after."""
    one = flight(live(), options=MissionConfig(resume_after=1.0))
    one.run_to(S.HOLDING)
    one.tell(command())
    one.turn()
    one.expect(S.FOLLOWING)
    assert one.status.reason == "following commands"
    one.run(0.5)
    one.expect(S.HOLDING)
    assert one.status.reason == "no fresh command"
    one.tell(add(Waypoint("plan", 20, 0, 1.5)))
    one.tell(command())
    one.turn()
    one.expect(S.DIVERTED)
    one.run(0.6)
    one.expect(S.DIVERTED)
    assert one.status.reason == "no fresh command"
    one.run(1.0)
    one.expect(S.ENROUTE)


def test_the_place_to_hold_is_where_the_drone_can_stop() -> None:
    """Ahead by its braking distance, and the same one until it moves again."""
    limits = LimitsConfig(cruise_speed=4.0, max_acceleration=2.0)
    one = flight(add(Waypoint("far", 60, 0, 1.5)), limits=limits)
    one.run(12.0)
    speed, x = float(one.vehicle.velocity[0]), float(one.vehicle.position[0])
    assert speed > 3.0
    one.tell(Pause())
    held = [one.turn().asked for _ in range(40)]
    for setpoint in held:
        assert isinstance(setpoint, PositionSetpoint)
        assert setpoint.position[0] == pytest.approx(x + speed**2 / 4, abs=0.3)
        assert setpoint.position.tolist() == held[0].position.tolist()  # type: ignore[union-attr]
    one.tell(Resume())
    one.run(2.0)
    one.tell(Pause())
    again = one.turn().asked
    assert isinstance(again, PositionSetpoint)
    assert again.position[0] > x + speed**2 / 4 + 1.0


def test_a_held_drone_that_is_blind_gets_no_place_to_hold() -> None:
    """Standing still is all that can be asked of it."""
    one = flight(add(*square()))
    one.run(10.0)
    one.vehicle.blind = True
    asked = one.turn().asked
    assert isinstance(asked, VelocitySetpoint)
    assert not asked.velocity.any()
    assert one.vehicle.mode is VehicleMode.GUIDED
    assert math.isnan(one.vehicle.read().odometry.position[0])


def test_a_way_home_that_is_walled_off_ends_in_a_landing() -> None:
    """A drone outside what leads home does not hover until it is empty."""
    wall = [(4.0, -6.0), (6.0, -6.0), (6.0, 26.0), (4.0, 26.0)]
    field = [(-5.0, -5.0), (25.0, -5.0), (25.0, 25.0), (-5.0, 25.0)]
    limits = LimitsConfig(geofence=GeofenceConfig(polygon=field, no_fly=[wall]))
    one = flight(add(Waypoint("near", 2, 0, 1.5, 5.0)), limits=limits)
    one.run_to(S.LOITERING)
    one.vehicle.position[0] = 10.0
    one.tell(ReturnHome())
    one.run()
    one.expect(S.LANDED)
    assert one.status.reason == "no way inside the geofence leads home"
    assert np.linalg.norm(one.vehicle.position[:2] - [10.0, 0.0]) < 1.5


def test_what_cannot_be_done_now_is_answered_with_why() -> None:
    """Each refusal is a plain no with a sentence."""
    one = flight(add(Waypoint("far", 20, 0, 1.5)))

    def refused(text: str) -> Answer:
        return Answer(accepted=False, text=text)

    assert one.tell(Start()) == refused("the mission has already been started")
    assert one.tell(Resume()) == refused("the mission is not paused")
    one.run(10.0)
    assert one.tell(Pause()) == one.tell(Resume()) == Answer(accepted=True)
    assert one.tell(Resume()) == refused("the mission is not paused")
    assert one.tell(ReturnHome()) == Answer(accepted=True)
    assert one.tell(Pause()) == refused("a drone that is returning goes on")
    assert one.tell(End("now")) == Answer(accepted=True)
    assert one.tell(Pause()) == refused("a drone that is landing goes on")
    assert one.tell(End()) == Answer(accepted=True, text="the drone is already landing")
    assert one.tell(ReturnHome()) == refused("the drone is already landing")
    one.run()
    assert one.tell(End()) == refused("the mission is over: landed")
    assert one.status.reason == "now"


def test_an_alert_bears_the_time_at_which_its_fault_was_found() -> None:
    """Of each kind; the same fault a turn later is none."""
    one = flight(add(Waypoint("far", 20, 0, 1.5)))
    one.run(10.0)
    for number, (name, value) in enumerate((("faults", ("GPS: no fix",)), ("lost", True)), 1):
        setattr(one.vehicle, name, value)
        found = one.now
        one.run(1.0)
        assert len(one.mission.alerts) == number
        assert one.mission.alerts[-1].header.stamp == found


@pytest.mark.parametrize(("up", "ended"), [(1.2, True), (1.19, False)])
def test_a_take_off_has_ended_within_the_radius_of_arrival(up: float, ended: bool) -> None:  # noqa: FBT001
    """At its edge it has, and not before the vehicle says that it has."""
    limits = LimitsConfig(takeoff_height=1.5, arrival_radius=0.3)
    one = flight(add(Waypoint("far", 20, 0, 1.5)), limits=limits)
    one.run_to(S.TAKING_OFF)
    one.vehicle.position[2] = up
    one.turn()
    one.expect(S.TAKING_OFF)
    one.vehicle.position[2], one.vehicle.mode = up, VehicleMode.HOLDING
    one.turn()
    one.expect(S.ENROUTE if ended else S.TAKING_OFF)


class Deaf(KinematicVehicle):
    """Misses the first order to take off."""

    heights: tuple[float, ...] = ()

    def take_off(self, height: float) -> None:
        """Hear the second one."""
        self.heights = (*self.heights, height)
        if len(self.heights) > 1:
            super().take_off(height)


def test_a_take_off_that_was_not_heard_is_ordered_again_to_the_same_height() -> None:
    """A second later, and the flight goes on."""
    one = flight(add(Waypoint("far", 5, 0, 3.0)), vehicle=Deaf(), limits=LimitsConfig())
    one.run()
    one.expect(S.LANDED)
    assert isinstance(one.vehicle, Deaf)
    assert one.vehicle.heights == (1.5, 1.5)
    assert one.status.visited == ("far",)


def test_a_place_is_asked_for_at_the_cruise_speed_or_its_own() -> None:
    """So it stands in the recording, before any limit."""
    limits = LimitsConfig(cruise_speed=2.0)
    slow = Waypoint("slow", 9, 0, 1.5, speed=0.7)
    one = flight(add(Waypoint("far", 5, 0, 1.5), slow), limits=limits)
    speeds = set[float | None]()
    while one.mission.state is not S.RETURNING:
        asked = one.turn().asked
        if isinstance(asked, PositionSetpoint) and one.mission.state is S.ENROUTE:
            speeds.add(asked.speed)
    assert speeds == {2.0, 0.7}


def test_a_drone_over_home_need_not_stand_still_in_height_to_land() -> None:
    """On its way up it turns round at once."""
    one = flight(add(Waypoint("far", 20, 0, 9.0)), limits=LimitsConfig(takeoff_height=9.0))
    one.run_to(S.TAKING_OFF)
    one.run(3.0)
    assert one.vehicle.velocity[2] > 0.9
    one.tell(ReturnHome("enough"))
    one.turn()
    one.expect(S.LANDING)
    assert one.status.reason == "enough"


class Refusing(KinematicVehicle):
    """Takes no order to take off."""

    def take_off(self, height: float) -> None:
        """Refuse it."""
        raise VehicleError(f"no {height:g} m today")


def test_a_refused_take_off_ends_the_mission_and_a_refusal_in_the_air_does_not() -> None:
    """People are told of both, with the vehicle's own words."""
    one = flight(add(*square()), vehicle=Refusing())
    one.turn()
    one.expect(S.ABORTED)
    assert one.status.reason == "the vehicle refused to take off: no 1.5 m today"
    assert [(a.kind, a.text) for a in one.mission.alerts] == [("refused", "no 1.5 m today")]
    flying = flight(add(*square()))
    flying.run(10.0)
    flying.mission.vehicle_refused("too windy")
    flying.expect(S.ENROUTE)
    assert [(a.kind, a.text) for a in flying.mission.alerts] == [("refused", "too windy")]


class Skipping(TrajectoryScheduler):
    """Leaves the last waypoint out."""

    isolated = False

    def plan(
        self,
        pending: Sequence[Waypoint],
        situation: PlanningContext,  # noqa: ARG002
    ) -> Sequence[Waypoint]:
        """Plan the others."""
        return pending[:-1]


def test_what_a_plan_leaves_out_is_given_up_and_told() -> None:
    """By its name and when it was decided; the others are flown."""
    one = flight(add(*square()[:2], ordered=False), scheduler=Skipping())
    one.run_to(S.LANDED)
    assert one.status.visited == ("wp1",)
    assert one.status.given_up == ("wp2",)
    (alert,) = one.mission.alerts
    assert (alert.kind, alert.text) == ("given_up", "the scheduler left wp2 out of its plan")
    assert alert.header.stamp == 0


def test_a_forecast_in_the_air_is_told_after_ten_seconds() -> None:
    """At ten seconds, not before; with what is needed and what is there, never less than none."""
    limits = LimitsConfig(endurance=600.0, battery_return=0.15, battery_land=0.12)
    one = flight(live(), limits=limits, vehicle=KinematicVehicle(charge=0.32))
    one.run(10.0)
    one.tell(add(Waypoint("far", 90, 0, 1.5)))
    short: float | None = None
    while not one.mission.alerts:
        one.turn()
        if short is None and any("at this rate" in fault for fault in one.status.faults):
            short = one.seconds
        assert one.seconds < 60.0
    assert short is not None
    assert one.seconds - short == pytest.approx(10.0)
    (alert,) = one.mission.alerts
    assert alert.kind == "unreachable_plan"
    assert "and 20% is there to spend" in alert.text
    empty = flight(
        add(Waypoint("far", 90, 0, 1.5)), limits=limits, vehicle=KinematicVehicle(charge=0.1)
    )
    empty.turn()
    assert "and 0% is there to spend" in empty.mission.alerts[0].text


def test_the_wind_is_reckoned_with() -> None:
    """By the scheduler, for the way against it costs more."""
    asked, wind = Asked(), np.array([3.0, -1.0, 0.0])
    robot = RobotConfig(id="drone")
    mission = Mission(robot, InlinePlanner(asked), takeoff=np.zeros(3), wind=wind)
    for order in (add(*square()), Start()):
        assert mission.handle(order, 0).accepted
    mission.update(KinematicVehicle().read(), 0)
    energy = asked.situations[0].energy
    assert energy is not None
    assert energy.wind.tolist() == wind.tolist()
