"""Waypoints handed over to the autopilot's own mission mode, and taken back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from autopilot import SETPOINT
from emulated import FAMILIES, FlownMission, Stepped, inject

from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import (
    AddNavigation,
    Answer,
    Command,
    End,
    HandOver,
    Pause,
    Resume,
    ReturnHome,
    TakeBack,
)
from aerodaas.mission.safety.neighbours import Neighbour
from tools.mavlink_vehicle import AutopilotOptions
from tools.mavlink_vehicle.flight import MavFlight

SQUARE = [
    Waypoint("a", 0, 15, 3),
    Waypoint("b", 15, 15, 3, hover_duration=2.0),
    Waypoint("c", 15, 0, 3, speed=1.0),
    Waypoint("d", 5, 0, 3),
]
LIMITS = {"cruise_speed": 3.0, "takeoff_height": 3.0, "arrival_radius": 0.5}


class Handed(FlownMission):
    """A mission whose waypoints are handed over to the autopilot."""

    def tell(self, command: Command) -> Answer:
        """Give the mission a command."""
        return self.mission.handle(command, self.now())

    def hand_over(self) -> None:
        """On the way to the first waypoint, and wait until the autopilot flies."""
        self.until(S.ENROUTE)
        answer = self.tell(HandOver())
        assert answer.accepted, answer.text
        self.until(lambda: self.mission.handover.flies)

    @property
    def plan(self) -> list[Any]:
        """The mission that the autopilot holds."""
        return self.ends.firmware.plans.plans[mavlink.MAV_MISSION_TYPE_MISSION]

    def setpoints(self) -> int:
        """How many the autopilot has heard."""
        return len(self.ends.heard(SETPOINT))


@contextmanager
def handed(
    monkeypatch: pytest.MonkeyPatch,
    family: str = "ardupilot",
    stops: list[Waypoint] | None = None,
    **settings: Any,  # noqa: ANN401
) -> Iterator[Handed]:
    """A mission to `stops`, on its way to the first of them after `until`."""
    limits = {**LIMITS, **settings.pop("limits", {})}
    options = AutopilotOptions(family=family)  # type: ignore[arg-type]
    with Stepped(monkeypatch, options, limits=limits, **settings) as ends:
        yield Handed(ends, SQUARE if stops is None else stops)


@pytest.mark.parametrize("family", FAMILIES)
def test_the_autopilot_flies_them_all(monkeypatch: pytest.MonkeyPatch, family: str) -> None:
    """Each waypoint is visited in order, without a setpoint of ours; then the mission goes home."""
    with handed(monkeypatch, family) as flight:
        flight.hand_over()
        assert flight.modes[-1] is VehicleMode.MISSION
        sent = flight.setpoints()
        flight.until(lambda: flight.visited == ["a"])
        status = flight.mission.status
        assert status.target is not None
        assert status.target.id == "b"
        assert "mission mode" in status.reason
        flight.until(S.LOITERING)
        flight.until(lambda: flight.visited == ["a", "b", "c"])
        assert flight.setpoints() == sent
        flight.until(S.RETURNING)
        assert flight.visited == ["a", "b", "c", "d"]
        flight.until(lambda: flight.mission.finished)
        assert flight.mission.state is S.LANDED, flight.story
        assert flight.told("handover") == [
            "handed over to the autopilot: 4 waypoints",
            "the hand-over has ended: all waypoints are flown",
        ]
        assert float(np.linalg.norm(flight.ends.autopilot.truth.position)) < 1.0


@pytest.mark.parametrize("family", FAMILIES)
def test_what_is_uploaded(monkeypatch: pytest.MonkeyPatch, family: str) -> None:
    """Places, heights above the sea (the ground lies 488 m up), stays, speeds where they change.

    At the end come a stay and the way home.
    """
    with handed(monkeypatch, family) as flight:
        flight.hand_over()
        plan = flight.plan
        if family == "ardupilot":
            assert plan[0].frame == mavlink.MAV_FRAME_GLOBAL
            plan = plan[1:]
        speed, waypoint = mavlink.MAV_CMD_DO_CHANGE_SPEED, mavlink.MAV_CMD_NAV_WAYPOINT
        assert [item.command for item in plan] == [
            *(speed, waypoint, waypoint),
            *(speed, waypoint, speed, waypoint),
            *(mavlink.MAV_CMD_NAV_LOITER_TIME, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH),
        ]
        assert [item.param2 for item in plan if item.command == speed] == [3.0, 1.0, 3.0]
        places = [item for item in plan if item.command == waypoint]
        assert [item.param1 for item in places] == [0.0, 2.0, 0.0, 0.0]
        assert {(item.frame, round(item.z, 1)) for item in places} == {
            (mavlink.MAV_FRAME_GLOBAL, 491.0)
        }
        origin = flight.ends.vehicle.connection.alignment.origin
        east, north, _ = origin.to_local(places[1].x / 1e7, places[1].y / 1e7, 0.0)
        assert (east, north) == pytest.approx((15.0, 15.0), abs=0.05)


@pytest.mark.parametrize("family", FAMILIES)
def test_taken_back_it_flies_on_from_what_was_not_reached(
    monkeypatch: pytest.MonkeyPatch, family: str
) -> None:
    """What was reached stays reached; the rest is flown by setpoints."""
    with handed(monkeypatch, family) as flight:
        flight.hand_over()
        flight.until(lambda: flight.visited == ["a"])
        assert flight.tell(TakeBack()).accepted
        assert not flight.tell(TakeBack()).accepted
        flight.until(VehicleMode.GUIDED, 5.0)
        flight.until(S.LANDING, 120.0)
        assert flight.visited == ["a", "b", "c", "d"]
        assert flight.told("handover")[-1] == "the hand-over has ended: asked to"


@pytest.mark.parametrize(
    ("family", "command", "state", "mode"),
    [
        ("px4", Pause(), S.PAUSED, VehicleMode.GUIDED),
        ("ardupilot", ReturnHome(), S.RETURNING, VehicleMode.GUIDED),
        ("px4", End(), S.LANDING, VehicleMode.LANDING),
    ],
)
def test_every_command_takes_them_back(
    monkeypatch: pytest.MonkeyPatch, family: str, command: Command, state: S, mode: VehicleMode
) -> None:
    """Within a moment the drone does what it was told, and no longer flies by the plan."""
    with handed(monkeypatch, family) as flight:
        flight.hand_over()
        assert flight.tell(command).accepted
        flight.turn()
        assert flight.mission.state is state
        assert not flight.mission.handover.active
        flight.until(mode, 5.0)


@pytest.mark.parametrize("family", ["px4"])
def test_taken_back_it_stops_at_once(monkeypatch: pytest.MonkeyPatch, family: str) -> None:
    """PX4 wants setpoints for more than a second before it follows them: it holds meanwhile."""
    with handed(monkeypatch, family) as flight:
        flight.hand_over()
        flight.until(lambda: float(np.linalg.norm(velocity(flight))) > 2.5)
        flight.run(1)
        motions = flight.ends.firmware.motions
        before = len(motions)
        flight.tell(Pause())
        flight.run(0.2)
        assert "hold" in motions[before:]
        flight.until(lambda: float(np.linalg.norm(velocity(flight))) < 0.3, 3.0)
        assert flight.tell(Resume()).accepted
        flight.until(lambda: flight.visited == ["a"])


def velocity(flight: Handed) -> Any:  # noqa: ANN401 - an array
    """Of the true drone, ENU m/s."""
    return flight.ends.autopilot.truth.velocity


def test_new_navigation_takes_them_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """The plan on the vehicle is not the mission's any more."""
    with handed(monkeypatch) as flight:
        flight.hand_over()
        more = AddNavigation(AeroNavigation(data=[Waypoint("e", 0, 5, 3)]))
        assert flight.tell(more).accepted
        flight.turn()
        assert (
            flight.told("handover")[-1]
            == "the hand-over has ended: what is to be flown has changed"
        )
        flight.until(S.RETURNING, 120.0)
        assert sorted(flight.visited) == ["a", "b", "c", "d", "e"]


def test_a_low_battery_takes_them_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """The failsafes go on while the autopilot flies."""
    with handed(monkeypatch, limits={"battery_return": 0.85}) as flight:
        flight.hand_over()
        monkeypatch.setattr(MavFlight, "charge", 0.8)
        flight.until(S.RETURNING, 10.0)
        flight.until(VehicleMode.GUIDED, 5.0)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_lost_link_takes_them_back(monkeypatch: pytest.MonkeyPatch, family: str) -> None:
    """After `link_timeout`; once the vehicle is heard again, it follows setpoints home."""
    with handed(monkeypatch, family) as flight:
        flight.hand_over()
        flight.ends.autopilot.cut()
        flight.until(S.RETURNING, 5.0)
        assert "no word from the vehicle" in flight.told("handover")[-1]
        flight.ends.autopilot.cut(off=False)
        flight.until(VehicleMode.GUIDED, 10.0)
        flight.until(S.LANDED, 60.0)


@pytest.mark.parametrize("family", ["px4"])
def test_a_short_loss_of_the_link_leaves_them_handed_over(
    monkeypatch: pytest.MonkeyPatch, family: str
) -> None:
    """Shorter than `link_timeout`, the autopilot flies on, and so does the mission afterwards."""
    with handed(monkeypatch, family, limits={"link_timeout": 5.0}) as flight:
        flight.hand_over()
        flight.ends.autopilot.cut()
        cut = flight.ends.now
        flight.until(lambda: flight.ends.now > cut + 4.0)
        assert flight.modes[-1] is VehicleMode.LOST
        assert flight.mission.handover.flies, flight.story
        flight.ends.autopilot.cut(off=False)
        flight.until(VehicleMode.MISSION, 3.0)
        flight.until(S.RETURNING, 120.0)
        assert flight.visited == ["a", "b", "c", "d"]
        assert flight.told("handover")[1:] == ["the hand-over has ended: all waypoints are flown"]


def test_a_stall_of_the_whole_process_leaves_them_handed_over(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Neither thread has turned: the loop does not hang, and nobody left the mission mode."""
    with handed(monkeypatch) as flight:
        flight.hand_over()
        for _ in range(200):
            flight.ends.clock.now += 0.01
            flight.ends.autopilot.turn(flight.ends.now)
        flight.until(VehicleMode.MISSION, 3.0)
        flight.until(S.RETURNING, 120.0)
        assert flight.told("handover")[1:] == ["the hand-over has ended: all waypoints are flown"]


def test_a_loop_that_hangs_is_told_as_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    """The link's thread has told the vehicle to hold meanwhile."""
    with handed(monkeypatch) as flight:
        flight.hand_over()
        flight.ends.advance(2.0)
        assert "hold" in flight.ends.firmware.motions
        flight.until(lambda: not flight.mission.handover.flies, 3.0)
        assert "the control loop hung" in flight.told("handover")[-1]


@pytest.mark.parametrize(
    ("family", "moved"),
    [("px4", (0.0, 0.0, 8.0)), ("ardupilot", (4.0, 0.0, 0.0)), ("px4", (0.0, -25.0, 0.0))],
)
def test_a_home_that_is_moved_is_told_and_moves_nothing(
    monkeypatch: pytest.MonkeyPatch, family: str, moved: tuple[float, float, float]
) -> None:
    """Within two seconds it is told and taken back; the drone stays at its height."""
    with handed(monkeypatch, family) as flight:
        flight.hand_over()
        flight.ends.firmware.home = flight.ends.firmware.home + moved
        began = flight.ends.now
        while flight.ends.now < began + 2.0:
            flight.turn()
            assert flight.ends.autopilot.truth.position[2] == pytest.approx(3.0, abs=0.5)
        off = f"{np.linalg.norm(moved):.0f} m from where it took off"
        assert flight.told("handover")[-1] == f"the hand-over has ended: its home has moved, {off}"
        alerts = [alert.text for alert in flight.mission.alerts]
        assert alerts.count(f"home: its own return leads {off}") == 1
        flight.until(S.LANDED, 120.0)
        assert flight.visited == ["a", "b", "c", "d"]


@pytest.mark.parametrize("family", ["ardupilot"])
def test_a_pilot_who_takes_over_is_respected(monkeypatch: pytest.MonkeyPatch, family: str) -> None:
    """Hands off: the mission is over, and nothing more is sent."""
    with handed(monkeypatch, family) as flight:
        flight.hand_over()
        flight.ends.autopilot.take_over()
        flight.until(lambda: flight.mission.finished, 5.0)
        assert flight.mission.state is S.ABORTED
        assert "pilot" in flight.mission.status.reason
        sent = flight.setpoints(), len(flight.ends.heard("COMMAND_LONG"))
        flight.run(3)
        assert (flight.setpoints(), len(flight.ends.heard("COMMAND_LONG"))) == sent


def test_a_pilots_own_mission_is_a_pilots(monkeypatch: pytest.MonkeyPatch) -> None:
    """The mission mode that we have not asked for is no hand-over."""
    with handed(monkeypatch) as flight:
        flight.hand_over()
        flight.tell(TakeBack())
        flight.until(VehicleMode.GUIDED, 5.0)
        flight.run(4)
        flight.ends.firmware.obey(
            mavlink.MAV_CMD_DO_SET_MODE, (1.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0), None
        )
        flight.until(lambda: flight.mission.finished, 5.0)
        assert flight.mission.state is S.ABORTED, flight.story


@pytest.mark.parametrize("family", ["ardupilot"])
def test_a_boundary_takes_them_back(monkeypatch: pytest.MonkeyPatch, family: str) -> None:
    """An autopilot that flies out of the fence is stopped before it."""
    fence = {"polygon": [(-20, -20), (20, -20), (20, 20), (-20, 20)], "margin": 1.0}
    limits = {"geofence": fence, "max_acceleration": 2.0}
    with handed(monkeypatch, family, limits=limits) as flight:
        flight.hand_over()
        plan = flight.plan
        for item in plan:
            item.x += 10_000  # a hundred metres north: whoever changed it
        flight.until(lambda: not flight.mission.handover.flies, 20.0)
        assert flight.told("handover")[-1].endswith("it came too near to a boundary (geofence)")
        flight.until(lambda: flight.visited == ["a"], 20.0)
        assert flight.ends.autopilot.truth.position[1] < 19.0


@pytest.mark.parametrize("family", ["px4"])
def test_another_drone_takes_them_back(monkeypatch: pytest.MonkeyPatch, family: str) -> None:
    """It stands in the way; the setpoints keep away from it."""
    with handed(monkeypatch, family, limits={"separation": 3.0}) as flight:
        flight.hand_over()
        flight.neighbours = [Neighbour(np.array([0.0, 12.0, 3.0]), np.zeros(3))]
        flight.until(lambda: not flight.mission.handover.flies, 10.0)
        assert "separation" in flight.told("handover")[-1]
        flight.run(5)
        away = np.linalg.norm(flight.ends.autopilot.truth.position - [0.0, 12.0, 3.0])
        assert away > 2.5


LIES = {
    "a place that it was not at": (
        mavlink.MAVLink_mission_item_reached_message(5),
        "it says that it was at a, and was never nearer than",
    ),
    "an item that there is not": (
        mavlink.MAVLink_mission_item_reached_message(99),
        "it speaks of item 99 of a plan of 10 items",
    ),
    "a current item far ahead": (
        mavlink.MAVLink_mission_current_message(7, 9),
        "it says that it was at a, and was never nearer than",
    ),
}


@pytest.mark.parametrize("lie", LIES)
def test_what_cannot_be_is_not_believed(monkeypatch: pytest.MonkeyPatch, lie: str) -> None:
    """They are taken back, and all that was not reached is flown."""
    message, told = LIES[lie]
    with handed(monkeypatch) as flight:
        flight.hand_over()
        inject(flight.ends, message)
        flight.turn()
        flight.turn()
        assert not flight.mission.handover.active
        assert told in flight.told("handover")[-1]
        flight.until(S.RETURNING, 120.0)
        assert flight.visited == ["a", "b", "c", "d"]


def test_going_back_is_not_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody has sent it to a place where it has been."""
    with handed(monkeypatch) as flight:
        flight.hand_over()
        flight.until(lambda: flight.ends.autopilot.truth.position[0] > 5.0)
        flight.ends.firmware.route.select(2)
        flight.until(lambda: not flight.mission.handover.active, 5.0)
        assert "to a place again" in flight.told("handover")[-1]


def test_one_that_comes_no_nearer_is_taken_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """It stands still in its mission mode, and says nothing more."""
    with handed(monkeypatch) as flight:
        flight.hand_over()
        firmware = flight.ends.firmware
        monkeypatch.setattr(firmware.route, "advance", lambda _: None)
        firmware.flight.hold()
        flight.until(lambda: not flight.mission.handover.active, 70.0)
        assert "no nearer to a for 60 s" in flight.told("handover")[-1]
        flight.until(lambda: flight.visited == ["a"])


def refuse_mode(flight: Handed, monkeypatch: pytest.MonkeyPatch) -> None:
    """The mode is refused."""
    monkeypatch.setattr(flight.ends.firmware.route, "begin", lambda: False)


def ignore_mode(flight: Handed, monkeypatch: pytest.MonkeyPatch) -> None:
    """The mode is accepted, and never shown."""
    firmware = flight.ends.firmware
    obey = firmware.obey

    def half(number: int, values: tuple[float, ...], frame: int | None) -> Any:  # noqa: ANN401
        mission = number == mavlink.MAV_CMD_DO_SET_MODE and (values[1], values[2]) in _MISSIONS
        return mavlink.MAV_RESULT_ACCEPTED if mission else obey(number, values, frame)

    monkeypatch.setattr(firmware, "obey", half)


_MISSIONS = {(3.0, 0.0), (4.0, 4.0)}


def stall(flight: Handed, monkeypatch: pytest.MonkeyPatch) -> None:
    """It stops answering in the middle of the upload."""
    plans = flight.ends.firmware.plans
    answer = plans.handle

    def half(message: Any) -> list[Any]:  # noqa: ANN401
        first_ones = message.get_type() == "MISSION_ITEM_INT" and message.seq < 3
        return answer(message) if first_ones or message.get_type() == "MISSION_COUNT" else []

    monkeypatch.setattr(plans, "handle", half)


def deny(flight: Handed, monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes no mission."""
    plans = flight.ends.firmware.plans
    ack = mavlink.MAVLink_mission_ack_message(245, 191, mavlink.MAV_MISSION_NO_SPACE, 0)
    monkeypatch.setattr(plans, "handle", lambda _: [ack])


def ignore_selection(flight: Handed, monkeypatch: pytest.MonkeyPatch) -> None:
    """It never says that it would begin with the first item."""
    route = flight.ends.firmware.route
    monkeypatch.setattr(route, "select", lambda _: False)
    monkeypatch.setattr(route, "_selected", 7)


FAILURES: dict[Callable[[Handed, pytest.MonkeyPatch], None], str] = {
    refuse_mode: "mode mission: ",
    ignore_mode: "does not show its mission mode",
    stall: "stopped answering while taking the mission",
    deny: "refused the mission: it has no room for so many",
    ignore_selection: "does not say that it would begin with the first",
}


@pytest.mark.parametrize("failure", FAILURES, ids=lambda one: one.__name__)
def test_a_hand_over_that_fails_leaves_the_drone_as_it_was(
    monkeypatch: pytest.MonkeyPatch, failure: Callable[..., None]
) -> None:
    """It flies on by setpoints all the time, and people are told why."""
    stops = [Waypoint("a", 0, 40, 3), Waypoint("b", 4, 40, 3)]
    family = "px4" if failure is refuse_mode else "ardupilot"
    with handed(monkeypatch, family, stops=stops) as flight:
        flight.until(S.ENROUTE)
        failure(flight, monkeypatch)
        assert flight.tell(HandOver()).accepted
        assert not flight.tell(HandOver()).accepted
        flight.until(lambda: not flight.mission.handover.active, 15.0)
        assert flight.told("handover")[-1].startswith("not handed over: ")
        assert FAILURES[failure] in flight.told("handover")[-1]
        flight.until(VehicleMode.GUIDED, 5.0)
        flight.until(S.RETURNING, 120.0)
        assert flight.visited == ["a", "b"]
        assert flight.states[flight.states.index(S.ENROUTE) :] == [S.ENROUTE, S.RETURNING]


UNFLYABLE: dict[str, tuple[Waypoint, str]] = {
    "picture": (Waypoint("w", 0, 9, 3, photo=True), "w: it takes pictures"),
    "trigger": (Waypoint("w", 0, 9, 3, trigger_distance=2.0), "w: it takes pictures"),
    "gimbal": (Waypoint("w", 0, 9, 3, gimbal_pitch=-1.0), "w: it turns the gimbal"),
    "lens": (Waypoint("w", 0, 9, 3, zoom=20.0), "w: it sets the camera's lens"),
    "video": (Waypoint("w", 0, 9, 3, video=True), "w: it begins or ends a video"),
    "look_at": (Waypoint("w", 0, 9, 3, look_at=(0, 0, 0)), "the gimbal is kept on a place"),
    "yaw": (Waypoint("w", 0, 9, 3, yaw=1.0), "turns to no yaw"),
    "no-fly zone": (Waypoint("w", 0, 9, 3), "w: the way there leads around a no-fly zone"),
}


@pytest.mark.parametrize("what", UNFLYABLE)
def test_what_an_autopilot_cannot_fly_is_refused(
    monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    """With the waypoint's name and the reason; nothing is uploaded."""
    waypoint, reason = UNFLYABLE[what]
    zone = {"no_fly": [[(-2, 4), (2, 4), (2, 6), (-2, 6)]]} if what == "no-fly zone" else {}
    fence = {"polygon": [(-50, -50), (50, -50), (50, 50), (-50, 50)], "margin": 0.5, **zone}
    with handed(monkeypatch, stops=[waypoint], limits={"geofence": fence}) as flight:
        flight.until(S.ENROUTE)
        answer = flight.tell(HandOver())
        assert not answer.accepted
        assert reason in answer.text
        assert not flight.ends.heard("MISSION_COUNT")


def test_on_the_ground_nothing_is_handed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor while it takes off, nor once it comes home."""
    with handed(monkeypatch) as flight:
        assert "preflight" in flight.tell(HandOver()).text
        flight.until(S.TAKING_OFF)
        assert "taking_off" in flight.tell(HandOver()).text
        flight.until(S.ENROUTE)
        flight.tell(ReturnHome())
        assert not flight.tell(HandOver()).accepted


def test_a_waypoint_that_is_reached_meanwhile_is_not_flown_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The rest is uploaded anew."""
    stops = [Waypoint("a", 0, 3, 3), Waypoint("b", 0, 20, 3), Waypoint("c", 0, 30, 3)]
    with handed(monkeypatch, stops=stops) as flight:
        flight.until(S.ENROUTE)
        plans = flight.ends.firmware.plans
        answer = plans.handle

        def slowly(message: Any) -> list[Any]:  # noqa: ANN401
            return answer(message) if flight.visited else []

        monkeypatch.setattr(plans, "handle", slowly)
        assert flight.tell(HandOver()).accepted
        flight.until(lambda: flight.mission.handover.flies)
        assert flight.told("handover") == ["handed over to the autopilot: 2 waypoints"]
        flight.until(S.RETURNING)
        assert flight.visited == ["a", "b", "c"]
