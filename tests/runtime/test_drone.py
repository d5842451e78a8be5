"""The drone node: what one message or one robot raises is its own failure; the loop flies on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from drone_nodes import DroneFlight, UnreadableVehicle
from flying import hop, robot
from hosts import item_of

from aerodaas import AeroNavigation, NavigationType, Waypoint
from aerodaas.clock import NANOSECONDS
from aerodaas.errors import MissionError
from aerodaas.messages.mission import MissionState
from aerodaas.mission.commands import (
    AddNavigation,
    ClearNavigation,
    End,
    OpenStream,
    StreamItem,
)
from aerodaas.runtime.stream_names import setpoint_stream

_STREAM = "drone/evil"
_HOLD = {"on_complete": "hold"}


class Malicious:
    """Whatever one asks of it, it raises; once it has come through a stream."""

    def __len__(self) -> int:
        raise ZeroDivisionError("no length for you")

    def __eq__(self, other: object) -> bool:
        raise ZeroDivisionError("nor comparison")

    __hash__ = None  # type: ignore[assignment]

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        if name.startswith("__"):
            raise AttributeError(name)
        raise Mute

    def __bool__(self) -> bool:
        raise Mute


class Pretender:
    """Says of its class what makes any look at it fail."""

    @property  # type: ignore[misc] # the very attack
    def __class__(self) -> type:  # pyright: ignore[reportIncompatibleMethodOverride]
        raise Mute


class Mute(Exception):  # noqa: N818 - a person's class
    """Its words fail, too."""

    def __str__(self) -> str:
        raise ValueError


class Mine(Waypoint):
    """A waypoint that goes off in flight."""

    live = False

    @property
    def position(self) -> Any:  # noqa: ANN401
        """East, north and up, until it goes off."""
        if Mine.live:
            raise LookupError("boom")
        return np.array([self.x, self.y, self.z])


@pytest.fixture
def vehicle() -> Iterator[type[UnreadableVehicle]]:
    """The class of vehicles that a test can spoil."""
    yield UnreadableVehicle
    UnreadableVehicle.unreadable.clear()
    UnreadableVehicle.landings.clear()


def _loitering(**settings: Any) -> DroneFlight:  # noqa: ANN401
    """A drone in the air that stays at its waypoint."""
    flight = DroneFlight(
        "drone",
        robots=[robot(sensors=[], **settings)],
        initial={"drone": [AddNavigation(hop((2, 0), hover=900)), OpenStream(_STREAM)]},
        navigation=(_STREAM,),
    )
    flight.until(lambda: flight.is_in(MissionState.LOITERING))
    return flight


def _land(flight: DroneFlight) -> None:
    assert flight.command(End()).accepted
    (node,) = flight.nodes.values()
    flight.until(lambda: node.over)
    assert flight.is_in(MissionState.LANDED)
    assert flight.errors() == {}


def test_a_flight_takes_the_loops_period_at_each_step() -> None:
    """Twenty cycles a second, each with setpoint and status."""
    flight = _loitering()
    setpoints = flight.tap(setpoint_stream("drone"))
    before = flight.executor.clock.now()
    flight.fly(2.0)
    stamps = [message.stamp - before for message in setpoints()]
    assert stamps == [NANOSECONDS * number // 20 for number in range(1, 41)]


@pytest.mark.parametrize("kind", [Malicious, Pretender])
def test_an_item_that_raises_is_told_with_its_streams_name(kind: type) -> None:
    """Once, however many come; the drone flies on and obeys."""
    flight = _loitering()
    for _ in range(5):
        flight.send(_STREAM, kind())
    flight.fly(0.5)
    (told,) = flight.alerts("command_failed")
    assert told.text.startswith(f"an item of {_STREAM} failed: ")
    _land(flight)


def test_a_command_that_raises_is_refused() -> None:
    """Its sender is told what it raised; so is whoever sends what is no command at all."""
    flight = _loitering()
    answer = flight.command(StreamItem(_STREAM, Malicious()))
    assert not answer.accepted
    assert "ZeroDivisionError: no length for you" in answer.text
    nonsense: Any = Malicious()
    answer = flight.command(nonsense)
    assert not answer.accepted
    assert "Malicious is no command" in answer.text
    _land(flight)


def test_a_command_to_a_robot_that_does_not_fly_is_refused() -> None:
    """By its name, to whoever asked from afar, too."""
    flight = _loitering()
    (node,) = flight.nodes.values()
    with pytest.raises(MissionError, match="ghost does not fly"):
        node.command("ghost", End(), flight.executor.clock.now())
    _land(flight)


def test_a_command_shows_in_the_next_report() -> None:
    """Whoever commands and then reads sees its own command's effect."""
    flight = _loitering(mission=_HOLD)
    assert flight.command(AddNavigation(hop((2, 0), (3, 0), (3, 3)))).accepted
    assert [waypoint.id for waypoint in flight.status().pending] == ["wp1", "wp2"]
    assert flight.command(ClearNavigation()).accepted
    assert flight.status().pending == ()
    _land(flight)


def test_commands_after_the_end_are_refused() -> None:
    """The answer says how the mission ended."""
    flight = _loitering()
    _land(flight)
    answer = flight.command(End())
    assert not answer.accepted
    assert "landed" in answer.text


def test_a_cycle_that_raises_empties_the_queue_and_the_drone_hovers() -> None:
    """What lay in the queue is gone, people are told once, and new navigation is flown."""
    flight = _loitering(mission=_HOLD)
    mined = AeroNavigation(NavigationType.DISTANCE_DRIVEN, [Mine("mine", 9.0, 0.0, 2.0)])
    assert flight.command(AddNavigation(mined, index=0)).accepted
    Mine.live = True
    try:
        flight.until(lambda: bool(flight.alerts("turn_failed")))
    finally:
        Mine.live = False
    flight.fly(1.0)
    (told,) = flight.alerts("turn_failed")
    assert "LookupError: boom" in told.text
    assert flight.status().pending == ()
    assert flight.command(AddNavigation(hop((0, 3)))).accepted
    flight.until(lambda: flight.status().visited[-1:] == ("wp0",))
    _land(flight)


def test_a_mission_whose_every_cycle_raises_ends_after_a_second(
    vehicle: type[UnreadableVehicle],
) -> None:
    """The node fails as a whole, and the alert about the first such cycle is the only one."""
    flight = _loitering(driver="drone_nodes:UnreadableVehicle")
    before = flight.executor.clock.now()
    vehicle.unreadable.add("drone")
    flight.until(lambda: bool(flight.errors()))
    assert flight.executor.clock.now() - before == NANOSECONDS
    assert "TypeError" in flight.errors()["drone"]
    assert len(flight.alerts("turn_failed")) == 1
    (node,) = flight.nodes.values()
    node.abandon()
    assert vehicle.landings == ["drone"]


def test_alerts_of_two_drones_of_a_node_say_whose_they_are() -> None:
    """Both raise the same at once; neither is lost, and each names its own drone."""
    robots = [robot(name, sensors=[], settings={"battery": 0.1}) for name in ("west", "east")]
    initial = {name: [AddNavigation(hop((1, 0)))] for name in ("west", "east")}
    flight = DroneFlight("west+east", robots=robots, initial=initial)
    flight.fly(30.0)
    told = flight.alerts("takeoff_refused")
    assert {alert.header.source for alert in told} == {"drone/west", "drone/east"}


_ROBOTS = {
    "west": ((0.0, 0.0, 0.0), (20.0, 0.0)),
    "east": ((20.0, 0.0, 0.0), (-20.0, 0.0)),
    "north": ((0.0, 60.0, 0.0), (5.0, 0.0)),
}
"""Start, and the way from there: west and east are sent to each other's place."""
_SETTINGS: dict[str, Any] = {
    "driver": "drone_nodes:UnreadableVehicle",
    "limits": {"cruise_speed": 2.0, "separation": 3.0, "takeoff_height": 2.0},
    "mission": {"stall_timeout": 3600.0},
}


def _three(*names: str) -> DroneFlight:
    """Drones in nodes of these names."""
    robots = [
        robot(name, start=start, sensors=[], **_SETTINGS) for name, (start, _) in _ROBOTS.items()
    ]
    initial = {name: [AddNavigation(hop(way, hover=900))] for name, (_, way) in _ROBOTS.items()}
    return DroneFlight(*names, robots=robots, initial=initial)


def test_drones_of_different_nodes_keep_their_distance() -> None:
    """Sent to each other's place on one line, both are slowed down for the other one."""
    flight = _three("west+north", "east")
    taps = {name: flight.tap(setpoint_stream(name)) for name in _ROBOTS}
    slowed: set[str] = set()
    nearest = 20.0
    for _ in range(60):
        flight.fly(0.5)
        for name, setpoints in taps.items():
            if any("separation" in item_of(message).clipped_by for message in setpoints()):
                slowed.add(name)
        apart = float(np.linalg.norm(flight.position("east") - flight.position("west")))
        nearest = min(nearest, apart)
    assert slowed == {"west", "east"}
    assert 2.0 < nearest < 5.0


def test_a_node_that_tells_nothing_any_more_is_told_of() -> None:
    """Its drones were in the air: the others keep away from them, and their operator knows."""
    flight = _three("west+north", "east")
    flight.until(lambda: flight.is_in(MissionState.ENROUTE, "east"))
    flight.executor.retire([flight.nodes["east"]])
    flight.fly(10.0)
    (told,) = {alert.text.partition(" ")[0] for alert in flight.alerts("neighbour_silent")}
    assert told == "east"


def test_the_failure_of_one_drone_is_no_other_ones(vehicle: type[UnreadableVehicle]) -> None:
    """It is left to itself and told by name; the others of its node fly on, obey and land."""
    flight = _three("west+north")
    (node,) = flight.nodes.values()
    flight.until(lambda: flight.is_in(MissionState.LOITERING, "north"))
    vehicle.unreadable.add("west")
    flight.until(lambda: bool(flight.alerts("drone_failed")))
    (told,) = flight.alerts("drone_failed")
    assert told.text.startswith("west: TypeError")
    assert vehicle.landings == ["west"]
    refused = flight.command(End(), "west")
    assert not refused.accepted
    assert "TypeError" in refused.text
    flight.fly(1.0)
    assert flight.is_in(MissionState.LOITERING, "north")
    assert flight.command(End(), "north").accepted
    flight.until(lambda: node.over)
    assert flight.is_in(MissionState.LANDED, "north")
    assert list(node.failures) == ["west"]
    before = list(vehicle.landings)
    node.abandon()
    assert vehicle.landings.count("north") == before.count("north"), "a pilot may fly it now"
