"""Grippers, servos, relays and parachutes by MAVLink: done, refused, silent, and lied about."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from emulated import Stepped

from aerodaas.config.model import MissionConfig
from aerodaas.config.sections.actuators import (
    ActuatorConfig,
    GripperConfig,
    ParachuteConfig,
    RelayConfig,
    ServoConfig,
)
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError
from aerodaas.extensions.actuators.equipment import Actuators, MoveResult
from aerodaas.messages.mission import MissionState
from aerodaas.messages.vehicle import equipment_of
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.mission import Mission
from tools.mavlink_vehicle import AutopilotOptions
from tools.mavlink_vehicle.actuators import EmulatedActuators

CARRIED: list[ActuatorConfig] = [
    GripperConfig(id="hook", type="gripper", instance=2),
    RelayConfig(id="pump", type="relay", instance=3),
    ServoConfig(id="hatch", type="servo", channel=9, positions={"open": 1900, "closed": 1100}),
    ParachuteConfig(id="chute", type="parachute", may_release=True),
    ParachuteConfig(id="locked", type="parachute"),
]
COMMANDS = [
    ("hook", "release", (mavlink.MAV_CMD_DO_GRIPPER, 2.0, 0.0)),
    ("hook", "grab", (mavlink.MAV_CMD_DO_GRIPPER, 2.0, 1.0)),
    ("pump", "on", (mavlink.MAV_CMD_DO_SET_RELAY, 3.0, 1.0)),
    ("pump", "off", (mavlink.MAV_CMD_DO_SET_RELAY, 3.0, 0.0)),
    ("hatch", "open", (mavlink.MAV_CMD_DO_SET_SERVO, 9.0, 1900.0)),
    ("chute", "disable", (mavlink.MAV_CMD_DO_PARACHUTE, 0.0, 0.0)),
    ("chute", "enable", (mavlink.MAV_CMD_DO_PARACHUTE, 1.0, 0.0)),
]


@pytest.fixture(params=["px4", "ardupilot"])
def ends(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Stepped:
    """Both families, which carry all of it."""
    options = AutopilotOptions(family=request.param, actuators=True)
    return Stepped(monkeypatch, options, CARRIED)


def actuators_of(ends: Stepped) -> Actuators:
    """The driver's."""
    actuators = equipment_of(ends.vehicle, Actuators)
    assert actuators is not None
    return actuators


def carried(ends: Stepped) -> EmulatedActuators:
    """What goes wrong with them."""
    return ends.autopilot.firmware.actuators


def result(ends: Stepped, timeout: float = 15.0) -> MoveResult:
    """The next word of a command."""
    said: list[MoveResult] = []
    end = ends.now + timeout
    while not said:
        assert ends.now < end, "waited in vain"
        ends.turn()
        said += actuators_of(ends).results()
    (one,) = said
    return one


def test_each_position_is_its_command(ends: Stepped) -> None:
    """With instance or channel, and the state that is to be reached; sent once where answered."""
    with ends:
        for name, position, command in COMMANDS:
            number = actuators_of(ends).move(name, position)
            assert result(ends) == MoveResult(number, accepted=True)
            assert carried(ends).asked[-1] == command
        assert len(carried(ends).asked) == len(COMMANDS)
        assert carried(ends).servos[8] == 1900
        assert ends.turn().actuators == {
            "hook": "grab",
            "pump": "off",
            "hatch": "open",
            "chute": "enable",
        }


@pytest.mark.parametrize("name", ["hook", "pump", "hatch"])
def test_a_refusal_is_told_at_once(ends: Stepped, name: str) -> None:
    """And the position is not taken for reached."""
    with ends:
        carried(ends).conduct = "refuse"
        position = next(one for one in CARRIED if one.id == name).positions
        number = actuators_of(ends).move(name, next(iter(position)))
        assert result(ends, 2.0) == MoveResult(number, accepted=False, reason="failed")
        assert ends.turn().actuators == {}


def test_silence_is_repeated_and_told(ends: Stepped) -> None:
    """Each time for the same state, never for the other one."""
    with ends:
        carried(ends).conduct = "silent"
        actuators_of(ends).move("hook", "release")
        assert result(ends) == MoveResult(1, accepted=False, reason="no answer")
        assert set(carried(ends).asked) == {(mavlink.MAV_CMD_DO_GRIPPER, 2.0, 0.0)}
        assert len(carried(ends).asked) == 6


@pytest.mark.parametrize(
    ("name", "position", "said"),
    [
        ("hatch", "open", "acknowledged, and not done: servo 9 is at 1500, not 1900 µs"),
        ("pump", "on", "acknowledged, and not done: relay 3 is the other way"),
    ],
)
def test_a_lie_is_found_out(ends: Stepped, name: str, position: str, said: str) -> None:
    """By what the autopilot itself says that it puts out."""
    with ends:
        carried(ends).conduct = "lie"
        actuators_of(ends).move(name, position)
        assert result(ends) == MoveResult(1, accepted=False, reason=said)
        assert ends.turn().actuators == {}


def test_commands_of_one_kind_do_not_replace_each_other(ends: Stepped) -> None:
    """One after the other, in order."""
    with ends:
        numbers = [actuators_of(ends).move("hook", one) for one in ("grab", "release", "grab")]
        assert [result(ends).number for _ in numbers] == numbers
        assert [one[2] for one in carried(ends).asked] == [1.0, 0.0, 1.0]


def test_a_doubled_acknowledgement_is_not_the_next_commands(ends: Stepped) -> None:
    """PX4 sends two: the second must not hide that the next command was not answered."""
    with ends:
        actuators_of(ends).move("hook", "grab")
        actuators_of(ends).move("hook", "release")
        assert result(ends).accepted
        carried(ends).conduct = "silent"
        assert result(ends).reason == "no answer"


def test_what_is_withdrawn_is_repeated_no_more(ends: Stepped) -> None:
    """And what waits behind it has its turn."""
    with ends:
        carried(ends).conduct = "silent"
        first = actuators_of(ends).move("hook", "release")
        second = actuators_of(ends).move("pump", "on")
        ends.watch(0.2)
        actuators_of(ends).withdraw(first)
        carried(ends).conduct = "obey"
        assert result(ends) == MoveResult(second, accepted=True)
        ends.watch(5.0)
        assert [one[0] for one in carried(ends).asked].count(mavlink.MAV_CMD_DO_GRIPPER) == 1
        assert actuators_of(ends).results() == []


@pytest.mark.parametrize("position", ["release", "released", "2", ""])
def test_no_position_fires_a_parachute(ends: Stepped, position: str) -> None:
    """Nor is one fired that may not be."""
    with ends:
        with pytest.raises(VehicleError):
            actuators_of(ends).move("chute", position)
        for name in ("locked", "hook"):
            with pytest.raises(VehicleError, match="may be fired"):
                actuators_of(ends).release_parachute(name)
        ends.watch(1.0)
        assert carried(ends).asked == []


def test_who_only_observes_moves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """As between missions, and by `aerodaas check`."""
    options = AutopilotOptions(actuators=True)
    with Stepped(monkeypatch, options, CARRIED, observe=True) as ends:
        with pytest.raises(VehicleError, match="observe"):
            actuators_of(ends).move("hook", "release")
        with pytest.raises(VehicleError, match="observe"):
            actuators_of(ends).release_parachute("chute")
        ends.watch(1.0)
        assert carried(ends).asked == []


def fly(ends: Stepped, each: Callable[[Mission], None] = lambda _: None) -> Mission:
    """A mission that drops its load; `each` is called at each turn."""
    stops = [
        Waypoint("a", 3, 0, 2, actuate={"hatch": "open", "hook": "release"}),
        Waypoint("b", 3, 3, 2, hover_duration=2.5, actuate={"hatch": "closed"}),
    ]
    return ends.mission(stops, MissionConfig.model_validate({"actuator_timeout": 4.0})).fly(each)


def test_a_mission_drops_its_load(ends: Stepped) -> None:
    """At its place, and closes the hatch at the next one."""
    with ends:
        mission = fly(ends)
        assert mission.state is MissionState.LANDED, mission.status.reason
        assert [alert.text for alert in mission.alerts if alert.kind == "actuator"] == []
        assert carried(ends).gripped is False
        assert [one[1:] for one in carried(ends).asked] == [
            (9.0, 1900.0),
            (2.0, 0.0),
            (9.0, 1100.0),
        ]
