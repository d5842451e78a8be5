"""What an application asks of actuators is checked at its own line, before anything flies."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from keywords import keywords

from aerodaas import AeroNavigation, Environment, Waypoint
from aerodaas.dataflow.mission_document import NavigationDocument
from aerodaas.errors import ConfigError, GraphError, InvalidWaypointError
from aerodaas.messages.serialization.schema import message_of

CARRIED: list[dict[str, Any]] = [
    {"id": "hook", "type": "gripper"},
    {"id": "hatch", "type": "servo", "channel": 9, "positions": {"open": 1900, "closed": 1100}},
    {"id": "chute", "type": "parachute"},
]


def environment(folder: Path, **robot: Any) -> Environment:  # noqa: ANN401
    """One drone that carries them."""
    file = folder / "environment.json"
    content = {"robots": [{"id": "drone", "actuators": CARRIED, **robot}]}
    file.write_text(json.dumps(content), encoding="utf-8")
    return Environment(file)


@pytest.mark.parametrize(
    ("moves", "said"),
    [
        ({"hok": "release"}, "no actuator is called 'hok'; did you mean hook?"),
        ({"hatch": "opn"}, "'hatch' has no position 'opn'; did you mean open?"),
        ({"chute": "release"}, "'chute' is a parachute, which no waypoint touches"),
    ],
)
def test_a_wrong_name_is_refused_with_the_applications_line(
    tmp_path: Path, moves: dict[str, str], said: str
) -> None:
    """Of `navigate`, and of the scheduler's navigation, which is given to a robot later."""
    env = environment(tmp_path)
    navigation = AeroNavigation(data=[Waypoint("drop", 0, 5, 2, actuate=moves)])
    with pytest.raises(GraphError) as refused:
        env.get_robot_by_id("drone").navigate(navigation)
    assert f"drone: waypoint 'drop': {said}" in str(refused.value)
    assert "test_actuators_checked.py:" in str(refused.value)
    env.get_robot_by_id("drone").navigate(AeroNavigation(data=[Waypoint("a", 0, 5, 2)]))
    env.trajectory_scheduler().add_navigation(navigation)
    with pytest.raises(GraphError, match="drone: waypoint 'drop': "):
        env.place_entries()


def test_a_wrong_command_is_refused_with_the_applications_line(tmp_path: Path) -> None:
    """And a parachute that may not be fired."""
    drone = environment(tmp_path).get_robot_by_id("drone")
    with pytest.raises(GraphError, match="did you mean hook"):
        drone.actuate("hok", "grab")
    with pytest.raises(GraphError, match=r"may not be fired[\s\S]*test_actuators_checked.py"):
        drone.release_parachute("chute")


@pytest.mark.parametrize(
    ("robot", "said"),
    [
        ({"driver": "tello"}, "actuators.0 (hook): the driver 'tello' cannot move a gripper"),
        ({"actuators": [CARRIED[0], CARRIED[0]]}, "more than one actuator of drone is called hook"),
        ({"actuators": [{"id": "a", "type": "winch"}]}, "robots.0.actuators.0"),
        ({"actuators": [{"id": "a", "type": "servo", "channel": 9}]}, "positions"),
        (
            {"actuators": [{**CARRIED[1], "positions": {"open": 100}}]},
            "greater than or equal to 500, not 100",
        ),
    ],
)
def test_a_wrong_section_is_refused(tmp_path: Path, robot: dict[str, Any], said: str) -> None:
    """With the place in the file."""
    with pytest.raises(ConfigError) as refused:
        environment(tmp_path, **robot)
    assert said in str(refused.value)
    assert "environment.json" in str(refused.value)


@pytest.mark.parametrize(
    "moves", ["hook", {"hook": 1}, [("hook",)], {1: "open"}, [("hook", "grab"), ("hook", "x")], 5]
)
def test_moves_are_positions_by_actuator(moves: Any) -> None:  # noqa: ANN401
    """Anything else is refused where it is written."""
    with pytest.raises(InvalidWaypointError, match="waypoint 'drop'"):
        Waypoint("drop", 0, 5, 2, actuate=moves)


def test_a_document_holds_moves_in_order() -> None:
    """There and back; one of version 0.1 has a field for them."""
    stop = Waypoint("drop", 0, 5, 2, actuate={"hatch": "open", "hook": "release"})
    text = NavigationDocument(robot="drone", waypoints=[stop]).model_dump_json()
    assert '"actions":[{"type":"move_actuator","actuator":"hatch","position":"open"},' in text
    (read,) = NavigationDocument.model_validate_json(text).waypoints
    assert read == stop
    assert list(keywords(read).actuate) == ["hatch", "hook"]
    moves = {"hatch": "open", "hook": "release"}
    assert message_of(Waypoint, {"id": "drop", "x": 0, "y": 5, "z": 2, "actuate": moves}) == stop
