"""What a fuzzed flight checks: a driver or mission without one of its safety rules is told."""

from __future__ import annotations

from typing import Any

import pytest

from aerodaas.drivers.pin import Peer, Pin
from aerodaas.geometry.frames import Vector
from aerodaas.messages.mission import MissionState
from aerodaas.mission.safety.setpoint_filter import SetpointFilter
from tools.fuzz.flight import ViolationError
from tools.fuzz.records import record
from tools.fuzz.targets import http, mavlink, tello

_SECOND = 20
"""Turns."""
_BY_HAND, _BY_PLAN = b"", b"-"
"""What follows a record: by the parity of an input's length somebody flies by hand."""


def _flown(target: Any, then: bytes) -> None:  # noqa: ANN401 - a module
    """Fly for a second in which the vehicle's own words are heard, and a byte that says nothing."""
    target.run(record(0, _SECOND, b"-") + then)


def _unbounded(_: object, velocity: Vector, *__: object) -> tuple[Vector, list[str]]:
    return velocity, []


@pytest.mark.parametrize("target", [mavlink, tello])
def test_a_filter_that_does_not_stop_at_the_fence_is_told(
    monkeypatch: pytest.MonkeyPatch,
    target: Any,  # noqa: ANN401
) -> None:
    """Where somebody who flies by hand wants to leave it."""
    for then in (_BY_HAND, _BY_PLAN):
        _flown(target, then)
    monkeypatch.setattr(SetpointFilter, "_stop_before_boundaries", _unbounded)
    with pytest.raises(ViolationError, match="out of the fence"):
        _flown(target, _BY_HAND)


def test_so_it_is_where_requests_command_the_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever they ask: the flight is on its way before the first of them."""
    by_plan, by_hand = b"", b"\n"
    for data in (by_plan, by_hand):
        http.run(data)
    assert http._on_its_way()[2].state is MissionState.ENROUTE
    monkeypatch.setattr(SetpointFilter, "_stop_before_boundaries", _unbounded)
    http.run(by_plan)
    with pytest.raises(ViolationError, match="out of the fence"):
        http.run(by_hand)


def test_a_link_that_follows_a_stranger_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever sends as the vehicle would be told what is the vehicle's."""
    forged = list(mavlink.seeds())[2]
    mavlink.run(forged)

    def admits(pin: Pin, peer: Peer, now: float, **_: bool) -> bool:
        pin.set(peer, now)
        return True

    monkeypatch.setattr(Pin, "admits", admits)
    with pytest.raises(ViolationError, match="told a stranger"):
        mavlink.run(forged)


@pytest.mark.parametrize("kind", [0, 1, 2, 3])
def test_the_first_records_are_heard_before_the_flight(
    monkeypatch: pytest.MonkeyPatch, kind: int
) -> None:
    """While the driver connects: from whom they are said to be."""
    heard = []
    for target in (mavlink, tello):
        hear = target._Rig.hear_record

        def noted(rig: Any, kind: int, body: bytes, hear: Any = hear) -> None:  # noqa: ANN401
            heard.append((rig.now, kind & 3, body))
            hear(rig, kind, body)

        monkeypatch.setattr(target._Rig, "hear_record", noted)
        target.run(record(kind | 0x40, 0, b"early") + record(kind, 0, b"late"))
        (early, *_), (late, *_) = heard
        assert early == pytest.approx(1000.05)
        assert late > early + 0.1
        assert [what for _, _, what in heard] == [b"early", b"late"]
        heard.clear()
