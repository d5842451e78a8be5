"""Each input of the fuzz target `http` meets the same flying mission."""

from __future__ import annotations

from typing import Any

import pytest

from tools.fuzz.flight import FuzzedFlight
from tools.fuzz.targets import http


def _flown(data: bytes, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """All setpoints and the states after them while `data` is run."""
    seen = []
    turn = FuzzedFlight.turn

    def watched(flight: FuzzedFlight) -> None:
        turn(flight)
        odometry = http._service()[0].drone.read().odometry
        seen.append((flight.state, *odometry.position, odometry.yaw))

    with monkeypatch.context() as patch:
        patch.setattr(FuzzedFlight, "turn", watched)
        http.run(data)
    return seen


def test_an_input_leaves_nothing_behind_for_the_next_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that ends the mission, and one that is refused, fly as they did before the others."""
    http.run(b"")  # the climb, which all share
    inputs = list(http.seeds())
    first = [_flown(data, monkeypatch) for data in inputs]
    again = [_flown(data, monkeypatch) for data in reversed(inputs)]
    assert first == again[::-1]
    assert len({str(flown) for flown in first}) > 1
