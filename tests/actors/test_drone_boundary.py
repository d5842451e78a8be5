"""What an item, a command or a waypoint raises is its own failure; the loop flies on."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from drone_by_hand import DroneByHand, drone_by_hand
from flying import hop
from publishing import send

from aerodaas import AeroNavigation, NavigationType, Waypoint
from aerodaas.mission.commands import AddNavigation, End, OpenStream, Request, StreamItem
from aerodaas.types.clock import host_time_ns
from aerodaas.types.data import Header
from aerodaas.types.status import MissionState

_STREAM = "drone/evil"
_FLYING = {MissionState.HOLDING, MissionState.ENROUTE, MissionState.LOITERING}


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

    def __reduce__(self) -> tuple[type, tuple[()]]:
        return Pretender, ()

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


def _flying(**words: Any) -> DroneByHand:  # noqa: ANN401
    first = AddNavigation(hop((2, 0), hover=900))
    streams = {"navigation": (_STREAM,), "requesters": ("drone/analysis",)}
    opened = OpenStream(_STREAM)
    return drone_by_hand(first, opened, speed=20.0, **streams, **words)


def _send(actor: DroneByHand, stream: str, item: object) -> None:
    if stream not in actor.publishers:
        actor.publisher(stream)
    send(actor.publishers[stream], item, Header(1, actor.clock.now(), stream), host_time_ns())


def _eventually(holds: Any) -> None:  # noqa: ANN401
    end = time.monotonic() + 15.0
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


def _land(actor: DroneByHand) -> None:
    _eventually(lambda: actor.robots()["drone"].status.state in _FLYING)
    assert actor.command("drone", End()).accepted
    _eventually(lambda: actor.report().phase == "done")
    assert actor.robots()["drone"].status.state is MissionState.LANDED
    assert actor.report().error is None
    actor.stop()


@pytest.mark.parametrize("kind", [Malicious, Pretender])
def test_an_item_that_raises_is_told_with_its_streams_name(kind: type) -> None:
    """Once, however many come; the drone flies on and obeys."""
    actor = _flying()
    actor.start(host_time_ns())
    for _ in range(5):
        _send(actor, _STREAM, kind())
    _eventually(lambda: any(one.kind == "command_failed" for one in actor.report().alerts))
    time.sleep(0.2)
    told = [one.text for one in actor.report().alerts if one.kind == "command_failed"]
    assert len(told) == 1
    assert told[0].startswith(f"an item of {_STREAM} failed: ")
    _land(actor)


def test_a_command_that_raises_is_refused() -> None:
    """Its sender is told what it raised; so is whoever sends what is no command at all."""
    actor = _flying()
    actor.start(host_time_ns())
    answer = actor.command("drone", StreamItem(_STREAM, Malicious()))
    assert not answer.accepted
    assert "ZeroDivisionError: no length for you" in answer.text
    nonsense: Any = Malicious()
    answer = actor.command("drone", nonsense)
    assert not answer.accepted
    assert "Malicious is no command" in answer.text
    _send(actor, "drone/analysis/@requests", Request(1, nonsense))
    _land(actor)


def test_a_turn_that_raises_empties_the_queue_and_the_drone_hovers() -> None:
    """What lay in the queue is gone, people are told once, and new navigation is flown."""
    Mine.live = False
    actor = _flying(mission={"on_complete": "hold"})
    actor.start(host_time_ns())
    _eventually(lambda: actor.robots()["drone"].status.state is MissionState.LOITERING)
    mined = AeroNavigation(NavigationType.DISTANCE_DRIVEN, [Mine("mine", 9.0, 0.0, 2.0)])
    assert actor.command("drone", AddNavigation(mined, index=0)).accepted
    Mine.live = True
    try:
        _eventually(lambda: any(one.kind == "turn_failed" for one in actor.report().alerts))
    finally:
        Mine.live = False
    [told] = [one.text for one in actor.report().alerts if one.kind == "turn_failed"]
    assert "LookupError: boom" in told
    assert actor.robots()["drone"].status.pending == ()
    assert actor.command("drone", AddNavigation(hop((0, 3)))).accepted
    _eventually(lambda: "wp0" in actor.robots()["drone"].status.visited)
    _land(actor)


def test_a_mission_whose_every_turn_raises_leaves_the_vehicle_to_itself() -> None:
    """After a second of such turns the loop fails as a whole, and the vehicle lands."""
    actor = _flying()
    actor.start(host_time_ns())
    _eventually(lambda: actor.robots()["drone"].status.state is MissionState.LOITERING)
    controller = actor._node._controllers["drone"]
    mission: Any = controller.mission
    mission.update = None
    _eventually(lambda: actor.report().phase == "failed")
    assert "TypeError" in str(actor.report().error)
    assert [one.kind for one in actor.report().alerts if one.kind == "turn_failed"] == [
        "turn_failed"
    ]
    actor.stop()
