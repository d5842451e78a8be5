"""Why a vehicle is no longer flown by us is told, though it says so after the fact."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import pytest
from stepped import Stepped
from stepped_missions import started

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.mission.loop import SetpointLoop
from aerodaas.types.status import MissionState
from aerodaas.types.waypoints import Waypoint
from tools.mavlink_vehicle import AutopilotOptions
from tools.mavlink_vehicle.firmware import Firmware

_PERIOD = 0.05


def fly(ends: Stepped, duration: float, loop: SetpointLoop) -> None:
    """Turn the mission's loop for `duration` seconds, or until it is over."""
    end = ends.now + duration
    while ends.now < end and not loop.mission.finished:
        ends.advance(_PERIOD)
        loop.turn(round(ends.now * 1e9))


def breach(firmware: Firmware) -> None:
    """Leave its own fence."""
    firmware.breach()


def battery(firmware: Firmware) -> None:
    """Return by its own battery failsafe."""
    firmware.enter_return()


def station(firmware: Firmware) -> None:
    """Return since it no longer hears the ground station that it listens to."""
    firmware.enter_return()


@pytest.mark.parametrize(
    ("family", "acts", "said", "why"),
    [
        ("ardupilot", breach, "", "its own geofence: outside"),
        ("ardupilot", battery, "Battery Failsafe", "Battery Failsafe"),
        ("ardupilot", station, "GCS Failsafe", "GCS Failsafe"),
        ("px4", breach, "", "its own geofence: outside"),
    ],
)
def test_why_its_own_protection_has_taken_over_is_told(
    monkeypatch: pytest.MonkeyPatch,
    family: Literal["px4", "ardupilot"],
    acts: Callable[[Firmware], None],
    said: str,
    why: str,
) -> None:
    """The reason comes a second after the mode; it is in the mission's, and no pilot is named."""
    parameters = {"FENCE_ENABLE": 1.0} if family == "ardupilot" else {"GF_ACTION": 3.0}
    options = AutopilotOptions(family=family, parameters=parameters)
    with Stepped(monkeypatch, options) as ends:
        loop = started(ends, [Waypoint("far", 60, 0, 3)])
        while loop.mission.state is not MissionState.ENROUTE:
            fly(ends, _PERIOD, loop)
        fly(ends, 3.0, loop)
        acts(ends.autopilot.firmware)
        fly(ends, 1.2, loop)
        if said:
            ends.autopilot.firmware.text(said, mavlink.MAV_SEVERITY_WARNING)
        fly(ends, 6.0, loop)
        mission = loop.mission
        assert mission.state is MissionState.ABORTED
        assert "own protection" in mission.status.reason
        assert why in mission.status.reason
        told = [alert.text for alert in mission.alerts if alert.kind in {"pilot", "failsafe"}]
        assert told == [mission.status.reason]


def test_a_pilot_within_his_own_fence_is_a_pilot(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing else explains the mode; no order is sent from the first moment on."""
    with Stepped(monkeypatch, AutopilotOptions(family="ardupilot")) as ends:
        loop = started(ends, [Waypoint("far", 60, 0, 3)])
        while loop.mission.state is not MissionState.ENROUTE:
            fly(ends, _PERIOD, loop)
        fly(ends, 3.0, loop)
        ends.autopilot.take_over()
        fly(ends, 1.5, loop)
        orders = len(ends.autopilot.heard)
        fly(ends, 6.0, loop)
        assert loop.mission.status.reason == "a pilot has taken over"
        kinds = {"SET_POSITION_TARGET_LOCAL_NED", "COMMAND_LONG", "COMMAND_INT"}
        later = [message for _, message in list(ends.autopilot.heard)[orders:]]
        assert not [one for one in later if one.get_type() in kinds]
