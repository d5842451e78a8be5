"""A provider's actuators: none for a tenant that was not given them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from offered import PILOT, Provider
from served import document

from aerodaas.cli.provider.serve import _actuators
from aerodaas.config.extensions import extensions
from aerodaas.config.model import EnvironmentConfig, validated
from aerodaas.errors import ConfigError
from aerodaas.protocol.schemas import MissionIn
from aerodaas.service.errors import RefusedError
from aerodaas.service.flights.environment import environment_of
from aerodaas.service.flights.orders import FlightOrder

pytestmark = pytest.mark.skipif(
    "actuators" not in extensions(), reason="no waypoint moves an actuator without the extension"
)

CARRIED: dict[str, Any] = {
    "actuators": [
        {"id": "hook", "type": "gripper"},
        {"id": "pump", "type": "relay"},
        {"id": "chute", "type": "parachute", "may_release": True},
    ]
}


@pytest.fixture
def one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Provider]:
    """A served whose tenant `farm` may move the hook of one drone."""
    may = {"farm": frozenset({"one/hook"}), "other": frozenset({"one/pump"})}
    made = Provider(tmp_path, monkeypatch, drone=CARRIED, actuators=may)
    yield made
    made.close()


def moving(robot: str, **moves: str) -> MissionIn:
    """A mission that moves actuators at its waypoint."""
    content: dict[str, Any] = document(robot, (5, 0))
    content["navigation"][0]["waypoints"][0]["actuate"] = moves
    return MissionIn.model_validate({"document": content})


@pytest.mark.parametrize(
    ("robot", "moves", "refused"),
    [
        ("one", {"pump": "on"}, "one/pump"),
        ("one", {"hook": "release", "chute": "disable"}, "one/chute"),
        ("two", {"hook": "release"}, "two/hook"),
    ],
)
def test_what_the_tenant_may_not_move_is_refused(
    one: Provider, robot: str, moves: dict[str, str], refused: str
) -> None:
    """By name, when it is submitted."""
    with pytest.raises(RefusedError, match=f"farm may not move {refused}: "):
        one.missions.submit(PILOT, moving(robot, **moves))


def test_what_it_may_move_is_in_its_flight_alone(one: Provider) -> None:
    """Waypoints that come in flight, and commands, meet the same environment."""
    one.monitor.see("one")
    mission = one.missions.submit(PILOT, moving("one", hook="release"))
    one.turns(2)
    one.monitor.held.clear()
    one.turns()
    assert one.started, one.missions.shown(mission.id).reason
    config = environment_of(FlightOrder.read(one.started[-1].order))
    assert [actuator.id for actuator in config.robots[0].actuators] == ["hook"]


def test_a_tenant_is_shown_what_it_may_move(one: Provider) -> None:
    """So that its applications are built against that."""
    one.fleet._catalogue = {"robots": [{"id": "one"}, {"id": "two"}]}
    shown = one.fleet.seen_by(PILOT).environment["robots"]
    hook = {"id": "hook", "type": "gripper", "instance": 1}
    assert shown == [{"id": "one", "actuators": [hook]}, {"id": "two", "actuators": []}]
    assert EnvironmentConfig.model_validate({"robots": shown})


def test_the_command_line_names_actuators_of_the_fleet() -> None:
    """And no parachute."""
    config = validated({"robots": [{"id": "one", **CARRIED}]}, "fleet")
    found = _actuators(["farm=one/hook", "farm=one/pump", "other=one/hook"], config)
    assert found == {"farm": {"one/hook", "one/pump"}, "other": {"one/hook"}}
    for wrong in ("farm=hook", "farm", "=one/hook", "farm=one/chute", "farm=one/hok"):
        with pytest.raises(ConfigError, match="known: one/hook, one/pump"):
            _actuators([wrong], config)
