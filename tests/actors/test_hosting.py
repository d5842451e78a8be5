"""Several drones in one actor, and several actors beside each other; and a failure among them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from drone_by_hand import DroneByHand, spec_by_hand
from flying import FLAT, hop, robot

from aerodaas.actors.streams import Subscriber
from aerodaas.config.model import EnvironmentConfig
from aerodaas.mission.commands import AddNavigation, End
from aerodaas.runtime.session import MESSAGE_DEPTH, Session
from aerodaas.runtime.stream_names import setpoint_stream
from aerodaas.types.clock import host_time_ns
from aerodaas.types.status import MissionState

pytestmark = pytest.mark.wall_clock

_ROBOTS = {
    "west": ((0.0, 0.0, 0.0), (20.0, 0.0)),
    "east": ((20.0, 0.0, 0.0), (-20.0, 0.0)),
    "north": ((0.0, 60.0, 0.0), (5.0, 0.0)),
}
"""Start, and the way from there: west and east are sent to each other's place."""


_SETTINGS: dict[str, Any] = {
    "limits": {"cruise_speed": 2.0, "separation": 3.0, "takeoff_height": 2.0},
    "mission": {"stall_timeout": 3600.0},
}


@contextmanager
def _actors(*groups: tuple[str, ...], speed: float = 10.0) -> Iterator[list[DroneByHand]]:
    """An actor for each group of robots, started at one moment, `speed` times as fast as life."""
    robots = [robot(name, start=start, **_SETTINGS) for name, (start, _) in _ROBOTS.items()]
    environment = EnvironmentConfig.model_validate({**FLAT, "robots": robots})
    session = Session(environment, speed)
    configs = {one.id: one for one in environment.robots}
    names = ["+".join(group) for group in groups]
    made = []
    for name, group in zip(names, groups, strict=True):
        specs = tuple(
            spec_by_hand(configs[one], AddNavigation(hop(_ROBOTS[one][1], hover=900)))
            for one in group
        )
        others = tuple(other for other in names if other != name)
        made.append(DroneByHand(session, name, specs, others))
    for actor in made:
        actor.open_here()
    origin = host_time_ns()
    for actor in made:
        actor.start(origin)
    try:
        yield made
    finally:
        for actor in made:
            actor.stop()


def _position(actor: DroneByHand, robot: str) -> Any:  # noqa: ANN401
    state = actor.robots()[robot].state
    assert state is not None
    return state.odometry.position


def _eventually(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + 30.0
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


def _is(actor: DroneByHand, robot: str, state: MissionState) -> bool:
    return actor.robots()[robot].status.state is state


def test_drones_of_different_actors_keep_their_distance() -> None:
    """Sent to each other's place on one line, both are slowed down for the other one."""
    slowed: set[str] = set()
    # A moment of a busy machine is not to be many metres of flight.
    with _actors(("west", "north"), ("east",), speed=2.0) as (first, second):
        streams = {setpoint_stream(name): name for name in ("west", "east", "north")}
        reader = Subscriber(first.scope, dict.fromkeys(streams, MESSAGE_DEPTH))

        def both() -> bool:
            for message in reader.receive(0.1):
                assert message.item is not None
                if "separation" in message.item.clipped_by:
                    slowed.add(streams[message.stream])
            return {"west", "east"} <= slowed

        _eventually(both)
        east, west = _position(second, "east"), _position(first, "west")
        assert float(np.linalg.norm(east - west)) > 1.0
        reader.close()
    assert "north" not in slowed


def test_an_actor_that_tells_nothing_any_more_is_told_of() -> None:
    """Its drones were in the air: the others keep away from them, and their operator knows."""
    with _actors(("west", "north"), ("east",)) as (first, second):
        _eventually(lambda: _is(second, "east", MissionState.ENROUTE))
        second.stop()

        def told() -> list[str]:
            return [one.text for one in first.report().alerts if one.kind == "neighbour_silent"]

        _eventually(lambda: bool(told()))
        assert {text.partition(" ")[0] for text in told()} == {"east"}


def test_the_failure_of_one_drone_is_no_other_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is left to itself and told by name; the others of its actor fly on, obey and land."""
    with _actors(("west", "north")) as (actor,):
        _eventually(lambda: _is(actor, "north", MissionState.LOITERING))
        controller = actor._node._controllers["west"]
        mission: Any = controller.mission
        mission.update = None
        _eventually(lambda: any(one.kind == "drone_failed" for one in actor.report().alerts))
        refused = actor.command("west", End())
        assert not refused.accepted
        assert "TypeError" in refused.text
        time.sleep(0.2)
        assert _is(actor, "north", MissionState.LOITERING)
        assert actor.report().phase == "running"
        assert actor.command("north", End()).accepted
        north = actor._node._controllers["north"]
        land, landed_again = north.vehicle.land, []

        def landing() -> None:
            landed_again.extend(["north"] if north.over else [])
            land()

        monkeypatch.setattr(north.vehicle, "land", landing)
        _eventually(lambda: actor.report().phase == "failed")
        assert _is(actor, "north", MissionState.LANDED)
        assert landed_again == [], "whose mission is over is left alone, for a pilot may fly it"
        assert str(actor.report().error).startswith("west: TypeError")
