"""A vehicle that signs, where its key is not: heard, and never taken for one that would obey."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from autopilot import Family, robot_of
from emulated import FAMILIES, LOOPBACK, Flight, free_port

from aerodaas.cli.app import main
from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.secrets import MAVLINK_KEY
from aerodaas.drivers.mavlink import connecting
from aerodaas.drivers.mavlink.autopilots.px4 import PX4
from aerodaas.drivers.mavlink.discovery import hear_vehicles
from aerodaas.drivers.mavlink.microservices.commander import Commander
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError
from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot

KEY = bytes(range(32))
TRUTH = "signs; no key is here"


@pytest.fixture(autouse=True)
def _no_key_of_the_host(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(MAVLINK_KEY, raising=False)
    monkeypatch.setattr(connecting, "_ANSWER", 2.0)


@contextmanager
def signing() -> Iterator[EnvironmentConfig]:
    """An autopilot that wants its key, in real time, and the environment of its drone."""
    port = free_port()
    with EmulatedAutopilot(AutopilotOptions(peer=(LOOPBACK, port), ready_after=0.0, key=KEY)):
        yield EnvironmentConfig(robots=[robot_of(port)])


@pytest.mark.parametrize("family", FAMILIES)
def test_it_is_not_connected_without_its_key(flight: Flight, family: Family) -> None:
    """What it says can be read, and nothing that we say is: found out before it is to fly."""
    ends = flight(AutopilotOptions(family=family, key=KEY))
    refused = pytest.raises(VehicleError, match=f"{TRUTH}.*{MAVLINK_KEY}.*signing_key")
    with refused, ends:
        pass
    assert not ends.vehicle.connected


def test_with_its_key_it_is_connected(flight: Flight, monkeypatch: pytest.MonkeyPatch) -> None:
    """Then it answers."""
    monkeypatch.setenv(MAVLINK_KEY, KEY.hex())
    with flight(AutopilotOptions(key=KEY)) as ends:
        assert ends.vehicle.connected


def test_one_that_obeys_the_unsigned_is_connected() -> None:
    """As an autopilot over USB does: it signs, and has answered all the same."""
    commander = Commander(lambda _: None, (1, 1), 245)
    commander.give(PX4().version(), now=0.0)
    answer = mavlink.MAVLink_command_ack_message(
        mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAV_RESULT_DENIED, target_system=245
    )
    connecting.require_answer(commander, "drone", lambda: commander.on_ack(answer, 0.0))


def test_preflight_says_so(
    flight: Flight,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Instead of a list on which all is good."""
    with flight(AutopilotOptions(key=KEY)).unconnected() as ends:
        content = EnvironmentConfig(robots=[ends.robot]).model_dump(
            mode="json", exclude_defaults=True
        )
        (tmp_path / "environment.json").write_text(json.dumps(content))
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(
            sys, "argv", ["aerodaas", "check", "environment.json", "--robot", "drone"]
        )
        with pytest.raises(SystemExit) as ended:
            main()
    told = " ".join(capsys.readouterr().err.split())
    assert ended.value.code not in {0, None}
    assert TRUTH in told


def test_discovery_says_so() -> None:
    """`aerodaas init --discover` finds it, and says what it will want."""
    with signing() as environment:
        (heard,) = hear_vehicles(1.5, [environment.robots[0].settings["url"]]).vehicles
    assert heard.signs
    assert MAVLINK_KEY in heard.text
