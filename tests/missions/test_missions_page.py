"""docs/missions.md says what the code does."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from scripted import ScriptedDetector

from aerodaas import Environment, Robot
from aerodaas.config.model import LimitsConfig
from aerodaas.config.plugins import plugin_names
from aerodaas.environment.run import Run
from aerodaas.messages.mission import MissionState
from aerodaas.mission.state_machine import FLYING, TRANSITIONS
from aerodaas.protocol.schemas import COMMANDS

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "missions.md").read_text(encoding="utf-8")


def blocks(kind: str) -> list[str]:
    """The code blocks of a kind."""
    return re.findall(rf"```{kind}\n(.*?)```", PAGE, re.DOTALL)


def test_the_table_of_states_has_every_transition() -> None:
    """The last column names the transitions that not all flying states have."""
    interrupt = frozenset.intersection(*(TRANSITIONS[state] for state in FLYING))
    rows = re.findall(r"^\| `(\w+)` \| .* \|(.*)\|$", PAGE.split("## Trajectory")[0], re.MULTILINE)
    found = {
        MissionState(name): {MissionState(one) for one in re.findall(r"`(\w+)`", targets)}
        for name, targets in rows
        if name in list(MissionState)
    }
    assert found == {
        state: targets - interrupt if state in FLYING else targets
        for state, targets in TRANSITIONS.items()
    }


def test_every_state_limit_scheduler_and_command_is_explained() -> None:
    """Tables name all states, limits with their defaults, schedulers and requests."""
    for state in MissionState:
        assert f"| `{state.value}` |" in PAGE
    limits = LimitsConfig()
    for name, value in re.findall(r"`limits\.(\w+)` ([0-9.]+)", PAGE):
        assert getattr(limits, name) == float(value), name
    for name in plugin_names("trajectory_schedulers"):
        assert f"| `{name}` |" in PAGE
    for name in COMMANDS:
        assert f"`{name}`" in PAGE


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[Robot]:
    """The drones that are started from here on, in the folder with the environments."""
    drones: list[Robot] = []
    monkeypatch.chdir(ROOT / "apps")
    monkeypatch.setattr(Robot, "start_mission", lambda drone: drones.append(drone))  # noqa: PLW0108
    return drones


@pytest.mark.parametrize("example", blocks("python")[:5])
def test_examples_build(example: str, started: list[Robot]) -> None:
    """Each example gives a graph that can be flown."""
    names: dict[str, object] = {}
    exec(blocks("python preamble")[0], names)  # noqa: S102 - our own page
    frames: Any = names["frames"]
    names["detections"] = ScriptedDetector("person", 0.0, 1.0, (0, 0, 1, 1)).analyse(frames)
    exec(example, names)  # noqa: S102 - our own page
    env = names["env"]
    assert isinstance(env, Environment)
    assert started == [names["drone"]]
    env.place_entries()
    assert Run(env).plan().drones
