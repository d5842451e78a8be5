"""Commands that look at a vehicle change nothing there, whatever a flight would set."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

import pytest
from command_line import exit_code
from emulated import LOOPBACK, free_port

from aerodaas.config.model import EnvironmentConfig
from aerodaas.drivers.loading import load_vehicle
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError
from aerodaas.messages.health import MeasuredVehicle
from aerodaas.messages.vehicle import Vehicle
from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot

pytestmark = pytest.mark.wall_clock

SETTING = {"fallback": "set", "failsafes": "set", "fence": "land", "role": "ground_station"}
"""Of a flight that sets all there is."""
COMMANDS = {
    "health": ["check", "environment.json", "--robot", "drone"],
    "check": ["check", "environment.json"],
    "logs": ["logs", "list", "drone"],
}
CHANGES = {"PARAM_SET", "MISSION_COUNT", "MISSION_CLEAR_ALL", "MISSION_ITEM_INT", "SET_MODE"}
"""Messages that change a vehicle's parameters, plans or mode."""
FLIES = {
    mavlink.MAV_CMD_DO_SET_MODE,
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
    mavlink.MAV_CMD_NAV_TAKEOFF,
}


def file_of(settings: dict[str, Any]) -> EnvironmentConfig:
    """Write an environment file with one drone here."""
    content = {"robots": [{"id": "drone", "driver": "mavlink", "settings": settings}]}
    Path("environment.json").write_text(json.dumps(content))
    return EnvironmentConfig.model_validate(content)


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr("aerodaas.cli.flying.preflight._SETTLING", 0.2)


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("family", ["ardupilot", "px4"])
def test_looking_changes_nothing(family: Literal["px4", "ardupilot"], command: str) -> None:
    """No parameter, no plan, no mode; and no heartbeat of a ground station that then falls silent.

    A vehicle waits for the heartbeats of its ground station (ArduPilot: of one system id), and
    comes home when they end.
    """
    port = free_port()
    options = AutopilotOptions(family=family, peer=(LOOPBACK, port), ready_after=0.0)
    with EmulatedAutopilot(options) as autopilot:
        before = dict(autopilot.firmware.parameters.values)
        file_of({"url": f"udpin:{LOOPBACK}:{port}", **SETTING})
        assert exit_code(*COMMANDS[command]) == 0
        heard = [message for _, message in autopilot.heard]
        assert autopilot.firmware.parameters.values == before
        assert not any(autopilot.firmware.plans.plans.values())
    kinds = {message.get_type() for message in heard}
    assert not kinds & CHANGES
    ordered = [one for one in heard if one.get_type() in {"COMMAND_LONG", "COMMAND_INT"}]
    assert not {one.command for one in ordered} & FLIES
    beats = {(one.type, one.get_srcSystem()) for one in heard if one.get_type() == "HEARTBEAT"}
    assert beats == {(mavlink.MAV_TYPE_ONBOARD_CONTROLLER, 244)}
    assert not list(Path("state").rglob("*.json"))


def observer(config: EnvironmentConfig) -> Vehicle:
    """The vehicle of the only robot, to be looked at."""
    return load_vehicle(config.robots[0], config, observing=True)


@pytest.mark.parametrize(
    ("fallback", "objects"), [("require", True), ("set", False), ("report", False)]
)
def test_what_a_flight_would_meet_is_judged(fallback: str, *, objects: bool) -> None:
    """With "require" a vehicle that would not come home is refused; with "set" a flight sees to it.

    It cannot be flown by who only looks.
    """
    port = free_port()
    options = AutopilotOptions(family="ardupilot", peer=(LOOPBACK, port), ready_after=0.0)
    with EmulatedAutopilot(options) as autopilot:
        settings = {"url": f"udpin:{LOOPBACK}:{port}", "fallback": fallback}
        vehicle = observer(file_of(settings))
        vehicle.connect()
        try:
            said = "; ".join(vehicle.preflight())
            assert ("would not come home without us: FS_GCS_ENABLE is 0" in said) is objects
            assert isinstance(vehicle, MeasuredVehicle)
            assert (vehicle.health().stranded == ()) is (fallback == "set")
            with pytest.raises(VehicleError, match="only looked at"):
                vehicle.take_off(2.0)
        finally:
            vehicle.close()
        assert not autopilot.armed
