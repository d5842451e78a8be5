"""Actuators at waypoints and by command: moved where they are to be, and nowhere else."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import pytest
from flights import Flight, KinematicVehicle, add, flight, passed_at

from aerodaas.config.model import LimitsConfig, MissionConfig
from aerodaas.config.sections.actuators import (
    ActuatorConfig,
    GripperConfig,
    ParachuteConfig,
    RelayConfig,
    ServoConfig,
)
from aerodaas.errors import VehicleError
from aerodaas.extensions.actuators.equipment import MoveResult
from aerodaas.messages.mission import MissionState
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import Actuate, Pause, ReleaseParachute, Resume, ReturnHome

CARRIED: list[ActuatorConfig] = [
    GripperConfig(id="hook", type="gripper"),
    RelayConfig(id="pump", type="relay"),
    ServoConfig(id="hatch", type="servo", channel=9, positions={"open": 1900, "closed": 1100}),
    ParachuteConfig(id="chute", type="parachute", may_release=True),
    ParachuteConfig(id="locked", type="parachute"),
]
DROP = Waypoint("drop", 0, 5, 2, actuate={"hook": "release"})
STOPS = (DROP, Waypoint("next", 5, 5, 2))


@dataclass
class Carried:
    """Does what it is told at the next look, or as a test says."""

    vehicle: KinematicVehicle
    conduct: Literal["obey", "refuse", "silent", "lie"] = "obey"
    """`lie` answers with other numbers."""
    moves: list[tuple[str, str]] = field(default_factory=list)
    places: list[tuple[float, float]] = field(default_factory=list)
    """Where the vehicle was at each move, metres east and north."""
    withdrawn: list[int] = field(default_factory=list)
    positions: dict[str, str] = field(default_factory=dict)
    _results: list[MoveResult] = field(default_factory=list)

    def move(self, actuator: str, position: str) -> int:
        """Move at once."""
        self.moves.append((actuator, position))
        self.places.append((float(self.vehicle.position[0]), float(self.vehicle.position[1])))
        number = len(self.moves)
        if self.conduct == "refuse":
            self._results.append(MoveResult(number, accepted=False, reason="jammed"))
        elif self.conduct != "silent":
            told = number + 100 if self.conduct == "lie" else number
            self._results.append(MoveResult(told, accepted=True))
        return number

    def release_parachute(self, actuator: str) -> int:
        """Stop the motors."""
        if self.conduct == "obey":
            self.vehicle.mode = VehicleMode.FAILSAFE
        return self.move(actuator, "released")

    def withdraw(self, number: int) -> None:
        """Take note."""
        self.withdrawn.append(number)

    def results(self) -> list[MoveResult]:
        """What came of it."""
        results, self._results = self._results, []
        return results


class Hauler(KinematicVehicle):
    """A vehicle that carries something."""

    def __init__(self, conduct: Literal["obey", "refuse", "silent", "lie"] = "obey") -> None:
        super().__init__()
        self.actuators = Carried(self, conduct)

    @property
    def equipment(self) -> tuple[Carried]:
        """What it carries."""
        return (self.actuators,)


def prepared(
    vehicle: KinematicVehicle,
    *waypoints: Waypoint,
    carried: list[ActuatorConfig] = CARRIED,
    **options: Any,  # noqa: ANN401
) -> Flight:
    """A flight over `waypoints`."""
    return flight(
        add(*(waypoints or STOPS)),
        vehicle=vehicle,
        options=MissionConfig.model_validate({"actuator_timeout": 4.0, **options}),
        actuators=carried,
    )


def told(made: Flight, kind: str = "actuator") -> list[str]:
    """What people were told."""
    return [alert.text for alert in made.mission.alerts if alert.kind == kind]


def test_each_is_moved_at_its_waypoint_one_after_the_other() -> None:
    """In the order written, within the arrival radius, once; then the drone flies on."""
    vehicle = Hauler()
    both = Waypoint("both", 0, 5, 2, actuate={"hatch": "open", "pump": "on"})
    made = prepared(vehicle, both, Waypoint("off", 5, 5, 2, actuate={"pump": "off"}))
    made.run()
    made.expect(MissionState.LANDED)
    carried = vehicle.actuators
    assert carried.moves == [("hatch", "open"), ("pump", "on"), ("pump", "off")]
    for place, wanted in zip(carried.places, ((0, 5), (0, 5), (5, 5)), strict=True):
        assert math.dist(place, wanted) <= 0.3
    assert list(made.status.visited) == ["both", "off"]
    assert not told(made)


def test_the_drone_stays_until_it_is_done() -> None:
    """Without a hover of its own, no longer than the time-out, and asks no more after it."""
    vehicle = Hauler("silent")
    made = prepared(vehicle)
    made.run_to(MissionState.LOITERING)
    began = made.seconds
    made.run(until=lambda: made.mission.state is not MissionState.LOITERING)
    assert 3.5 < made.seconds - began < 4.5
    assert vehicle.actuators.withdrawn == [1]
    made.run()
    assert vehicle.actuators.moves == [("hook", "release")]


@pytest.mark.parametrize(
    ("conduct", "said"), [("refuse", "jammed"), ("silent", "within 4 s"), ("lie", "within 4 s")]
)
def test_what_fails_is_told_and_the_flight_goes_on(
    conduct: Literal["refuse", "silent", "lie"], said: str
) -> None:
    """By default; the other actuators of this waypoint are left alone, and named."""
    vehicle = Hauler(conduct)
    both = Waypoint("drop", 0, 5, 2, actuate={"hook": "release", "pump": "on"})
    made = prepared(vehicle, both, STOPS[1])
    made.run()
    made.expect(MissionState.LANDED)
    assert list(made.status.visited) == ["drop", "next"]
    (text,) = told(made)
    assert text.startswith("drop: hook: release: not done: ")
    assert said in text
    assert text.endswith("; nor pump")
    assert vehicle.actuators.moves == [("hook", "release")]


def test_a_failure_may_bring_the_drone_home() -> None:
    """With the reason, and without the next waypoint."""
    made = prepared(Hauler("refuse"), on_actuator_failure="return")
    made.run()
    made.expect(MissionState.LANDED)
    assert "hook: release: not done: jammed" in made.status.reason
    assert list(made.status.visited) == []


def test_a_failure_may_pause_the_flight() -> None:
    """Somebody may try again by command, and resume."""
    vehicle = Hauler("refuse")
    made = prepared(vehicle, on_actuator_failure="pause")
    made.run_to(MissionState.PAUSED)
    vehicle.actuators.conduct = "obey"
    assert made.tell(Actuate("hook", "release")).accepted
    assert made.tell(Resume()).accepted
    made.run()
    made.expect(MissionState.LANDED)
    assert list(made.status.visited) == ["drop", "next"]
    assert vehicle.actuators.moves == [("hook", "release")] * 2


@pytest.mark.parametrize("leave", [Pause(), ReturnHome()])
def test_a_drone_that_leaves_its_waypoint_withdraws_what_is_not_done(
    leave: Pause | ReturnHome,
) -> None:
    """A late repetition would drop the load elsewhere."""
    vehicle = Hauler("silent")
    made = prepared(vehicle)
    made.run(until=lambda: bool(vehicle.actuators.moves))
    made.tell(leave)
    for _ in range(10):
        made.turn()
    assert vehicle.actuators.withdrawn == [1]
    assert not told(made)
    if isinstance(leave, Pause):
        vehicle.actuators.conduct = "obey"
        made.tell(Resume())
        made.run()
        made.expect(MissionState.LANDED)
        assert vehicle.actuators.moves == [("hook", "release")] * 2
        assert list(made.status.visited) == ["drop", "next"]


def test_nothing_is_moved_where_the_drone_was_blown_away() -> None:
    """It has arrived, and is elsewhere now: the command waits until it is back, and then fails."""
    vehicle = Hauler()
    made = prepared(vehicle, Waypoint("drop", 0, 5, 2, actuate={"pump": "on", "hook": "release"}))
    made.run(until=lambda: len(vehicle.actuators.moves) == 1)
    for _ in range(200):
        vehicle.position = np.array([3.0, 5.0, 2.0])
        made.turn()
    assert vehicle.actuators.moves == [("pump", "on")]
    assert "the drone did not stay at its place" in told(made)[0]


@pytest.mark.parametrize(
    ("actuate", "said"),
    [
        ({"hok": "release"}, "no actuator is called 'hok'; did you mean hook?"),
        ({"hook": "relase"}, "'hook' has no position 'relase'; did you mean release?"),
        ({"chute": "released"}, "'chute' is a parachute, which no waypoint touches"),
        ({"chute": "disable"}, "'chute' is a parachute, which no waypoint touches"),
    ],
)
def test_what_is_not_carried_is_refused_in_flight_too(actuate: dict[str, str], said: str) -> None:
    """As by a live stream; the other waypoints are flown."""
    vehicle = Hauler()
    made = prepared(vehicle, Waypoint("bad", 0, 5, 2, actuate=actuate), STOPS[1])
    made.run()
    made.expect(MissionState.LANDED)
    assert said in made.mission._log.given_up["bad"]
    assert vehicle.actuators.moves == []


def test_a_vehicle_without_actuators_flies_on() -> None:
    """No driver needs to know of them."""
    made = prepared(KinematicVehicle())
    made.run()
    made.expect(MissionState.LANDED)
    assert told(made) == ["drop: hook: release: not done: the vehicle has no actuators"]


@pytest.mark.parametrize("error", [VehicleError("link down"), RuntimeError("a bug"), KeyError(1)])
def test_what_a_driver_raises_ends_no_flight(error: Exception) -> None:
    """An exception is a failure of the actuator alone."""

    class Broken:
        """Raises whatever it is asked."""

        def fail(self, *_: object) -> None:
            raise error

        move = release_parachute = withdraw = results = fail

    vehicle = Hauler()
    vehicle.actuators = Broken()  # type: ignore[assignment]
    made = prepared(vehicle)
    made.run()
    made.expect(MissionState.LANDED)
    assert told(made)


def test_a_command_moves_at_once_and_tells_a_failure() -> None:
    """On the ground as in the air; unknown names are refused."""
    vehicle = Hauler()
    made = prepared(vehicle)
    assert made.tell(Actuate("hook", "grab")).accepted
    assert "did you mean hook" in made.tell(Actuate("hok", "grab")).text
    assert "did you mean disable" in made.tell(Actuate("chute", "disabl")).text
    assert made.tell(Actuate("chute", "enable")).accepted
    vehicle.actuators.conduct = "refuse"
    assert made.tell(Actuate("pump", "on")).accepted
    made.turn()
    assert told(made) == ["pump: on: not done: jammed"]
    assert vehicle.actuators.moves == [("hook", "grab"), ("chute", "enable"), ("pump", "on")]


@pytest.mark.parametrize("word", ["release", "released", "enable ", "Release", ""])
def test_no_position_fires_a_parachute(word: str) -> None:
    """Whatever is written for one: it has a command of its own."""
    vehicle = Hauler()
    made = prepared(vehicle)
    made.run_to(MissionState.ENROUTE)
    assert not made.tell(Actuate("chute", word)).accepted
    assert vehicle.actuators.moves == []


def test_a_parachute_ends_the_flight_hands_off() -> None:
    """Not one setpoint is sent from its release on, nor any command of a mode."""
    vehicle = Hauler()
    made = prepared(vehicle)
    made.run_to(MissionState.ENROUTE)
    assert made.tell(ReleaseParachute("chute")).accepted
    made.turn()
    sent, calls = len(vehicle.sent), list(vehicle.calls)
    made.expect(MissionState.ABORTED)
    assert made.status.reason == "the parachute chute was released"
    assert told(made, "parachute") == ["the parachute chute was released"]
    for _ in range(40):
        made.turn()
    assert (len(vehicle.sent), vehicle.calls) == (sent, calls)
    assert not made.tell(Resume()).accepted


def test_a_parachute_that_does_not_open_leaves_a_drone_that_lands() -> None:
    """It was in need enough."""
    vehicle = Hauler("refuse")
    made = prepared(vehicle)
    made.run_to(MissionState.ENROUTE)
    assert made.tell(ReleaseParachute("chute")).accepted
    made.expect(MissionState.LANDING)
    made.run()
    made.expect(MissionState.LANDED)
    assert told(made, "parachute") == ["the parachute chute was not released: jammed"]


@pytest.mark.parametrize(
    ("name", "said"),
    [("locked", "may not be fired"), ("chut", "did you mean chute?"), ("hook", "no parachute")],
)
def test_a_parachute_is_fired_by_its_name_and_where_permitted(name: str, said: str) -> None:
    """Nothing else opens it."""
    vehicle = Hauler()
    made = prepared(vehicle)
    made.run_to(MissionState.ENROUTE)
    answer = made.tell(ReleaseParachute(name))
    assert not answer.accepted
    assert said in answer.text
    assert vehicle.actuators.moves == []


def test_no_parachute_is_fired_on_the_ground() -> None:
    """Before take-off and after the landing."""
    vehicle = Hauler()
    made = prepared(vehicle)
    assert "in the air only" in made.tell(ReleaseParachute("chute")).text
    made.run()
    assert not made.tell(ReleaseParachute("chute")).accepted
    assert ("chute", "released") not in vehicle.actuators.moves


def test_the_arrival_radius_bounds_the_place() -> None:
    """A wider one lets the command go out earlier."""
    vehicle = Hauler()
    made = flight(
        add(DROP), vehicle=vehicle, limits=LimitsConfig(arrival_radius=2.0), actuators=CARRIED
    )
    made.run()
    made.expect(MissionState.LANDED)
    assert 0.3 < math.dist(vehicle.actuators.places[0], (0, 5)) <= 2.0


SPRAYER: list[ActuatorConfig] = [
    GripperConfig(id="hook", type="gripper"),
    RelayConfig(id="pump", type="relay", rest="off"),
    RelayConfig(id="lamp", type="relay"),
    ServoConfig(
        id="hatch",
        type="servo",
        channel=9,
        positions={"open": 1900, "closed": 1100},
        rest="closed",
    ),
]
SPRAY = Waypoint("spray", 0, 5, 2, actuate={"pump": "on"})
FAR = Waypoint("far", 0, 300, 2)


def test_what_has_a_rest_is_given_it_on_the_way_home() -> None:
    """Once, whatever the reason; what has none stays as it is."""
    vehicle = Hauler()
    made = prepared(vehicle, SPRAY, FAR, carried=SPRAYER)
    made.run(until=lambda: "spray" in made.status.visited)
    assert vehicle.actuators.moves == [("pump", "on")]
    made.tell(ReturnHome("enough"))
    made.run()
    made.expect(MissionState.LANDED)
    assert vehicle.actuators.moves[1:] == [("pump", "off"), ("hatch", "closed")]
    assert not told(made)


def test_what_a_stop_asked_for_is_withdrawn_before_the_rest() -> None:
    """A pump that has not answered yet might be switched on after it was switched off."""
    vehicle = Hauler("silent")
    made = prepared(vehicle, SPRAY, FAR, carried=SPRAYER)
    made.run(until=lambda: bool(vehicle.actuators.moves))
    made.tell(ReturnHome("enough"))
    made.run(until=lambda: len(vehicle.actuators.moves) > 1)
    assert vehicle.actuators.withdrawn == [1]
    assert vehicle.actuators.moves[1] == ("pump", "off")


def test_it_is_given_its_rest_before_the_mission_is_over() -> None:
    """Nobody looks after a drone that was given up: its motors have stopped in the air."""
    vehicle = Hauler()
    made = prepared(vehicle, SPRAY, FAR, carried=SPRAYER)
    made.run(until=lambda: "spray" in made.status.visited)
    vehicle.kill()
    made.run(until=lambda: made.mission.finished)
    made.expect(MissionState.ABORTED)
    assert vehicle.actuators.moves[1:] == [("pump", "off"), ("hatch", "closed")]


def test_a_rest_that_is_not_taken_is_told() -> None:
    """Its refusal, and a vehicle that moves nothing at all; the drone comes home all the same."""
    for vehicle, reason in ((Hauler("refuse"), "jammed"), (KinematicVehicle(), "no actuators")):
        made = prepared(vehicle, Waypoint("there", 0, 5, 2), carried=SPRAYER)
        made.run()
        made.expect(MissionState.LANDED)
        pump, hatch = told(made)
        assert pump.startswith("pump: off: not done: ")
        assert hatch.startswith("hatch: closed: not done: ")
        assert reason in pump


def test_a_servo_rests_where_it_has_a_position() -> None:
    """A slip is told with what was perhaps meant."""
    with pytest.raises(ValueError, match="no position is called 'close'"):
        ServoConfig(id="x", type="servo", channel=1, positions={"closed": 1000}, rest="close")


def test_a_drone_stops_for_an_actuator() -> None:
    """Where it would fly through the waypoint otherwise."""
    row = [Waypoint(f"w{number}", 10.0 * number, 0.0, 2.0) for number in range(1, 4)]
    row[1] = replace(row[1], actuate={"hook": "release"})
    made = prepared(Hauler(), *row)
    assert passed_at(made, "w1") > 0.0
    assert passed_at(made, "w2") == 0.0
