"""What a guest is told of the owner's vehicle is without its secrets."""

from __future__ import annotations

import pickle
from typing import Any

import pytest
from filled import filled

from aerodaas.analytics.guests import analysis
from aerodaas.analytics.guests.analysis import GuestAnalysis
from aerodaas.config.grants import GuestQuota
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import VehicleState

STATE: VehicleState = filled(VehicleState, video="rtsp://me:password@10.0.0.2")


class Asked:
    """A guest's process that keeps what it is asked."""

    told = False

    def ask(self, _: object, blob: bytes, __: float) -> tuple[dict[str, Any], bytes]:
        """Answer that there is no result."""
        self.item, self.vehicle = pickle.loads(blob)  # noqa: S301 - written here
        return {}, b""


class Told:
    """A context that knows the vehicle."""

    kind = "edge"

    def now(self) -> int:
        """Mission time."""
        return 1

    def vehicle(self) -> VehicleState:
        """The vehicle's state."""
        return STATE

    def alert(self, _: Alert) -> None:
        """Tell nobody."""


def test_a_guest_is_not_told_of_the_cameras_address(monkeypatch: pytest.MonkeyPatch) -> None:
    """All else of the state that it may see is as the vehicle says."""
    process = Asked()
    monkeypatch.setitem(analysis._processes, "theirs", process)
    work = GuestAnalysis("theirs", "key", GuestQuota(), navigates=False, sees_vehicle=True)
    assert work.process(5, Told()) is None  # type: ignore[arg-type]
    assert process.item == 5
    assert process.vehicle == filled(VehicleState, video="")
