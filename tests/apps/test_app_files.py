"""The six applications are short, know nothing of the world, and their environments hold."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest

from aerodaas.config.model import EnvironmentConfig
from aerodaas.simulation.scenario import load_scenario
from aerodaas.simulation.world import World

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "benchmarks"))

from missions.catalogue import MISSIONS  # noqa: E402 - benchmarks are no package
from missions.figures import lines_of_code  # noqa: E402

MOST_LINES = 30
NAMES = sorted(MISSIONS)


def environment_of(name: str) -> EnvironmentConfig:
    """The environment that an application names."""
    text = MISSIONS[name].application.read_text()
    found = re.search(r'Environment\("([^"]+)"\)', text)
    assert found is not None
    return EnvironmentConfig.load(ROOT / "apps" / found[1])


@pytest.mark.parametrize("name", NAMES)
def test_an_application_is_short(name: str) -> None:
    """Imports count, comments, docstrings and blank lines do not."""
    assert lines_of_code(MISSIONS[name].application) <= MOST_LINES


def test_lines_are_counted_honestly(tmp_path: Path) -> None:
    """Everything but comments, docstrings and blank lines counts, strings in code, too."""
    path = tmp_path / "app.py"
    path.write_text('"""Two\nlines."""\n\nimport os  # a comment\n# another\ntext = """a\nb"""\n')
    assert lines_of_code(path) == 3


@pytest.mark.parametrize("name", NAMES)
def test_an_application_knows_nothing_of_the_world(name: str) -> None:
    """It imports nothing of the simulation, names nothing that stands there, and no driver."""
    text = MISSIONS[name].application.read_text()
    things = load_scenario(environment_of(name).simulation.world).entities
    words = set(re.findall(r'"([A-Za-z_\-0-9]+)"', text))
    assert "simulation" not in text
    assert not words & {thing.id for thing in things}
    assert not words & {"simulated", "mavlink"}


@pytest.mark.parametrize("name", NAMES)
def test_each_has_a_world_of_its_own(name: str) -> None:
    """Each seed moves or paints something; where the drone stands is free."""
    environment = environment_of(name)
    worlds = [World(load_scenario(environment.simulation.world), seed) for seed in (0, 1)]
    assert worlds[0].boxes(60.0) != worlds[1].boxes(60.0)
    for world in worlds:
        near = [box.id for box in world.boxes(0.0) if box.contains((0.0, 0.0, 0.5), 0.5)]
        assert set(near) <= {"crop"}


def test_the_worlds_differ() -> None:
    """No two applications share one."""
    worlds = [environment_of(name).simulation.world for name in NAMES]
    assert len(set(worlds)) == len(worlds)


@pytest.mark.parametrize("name", NAMES)
def test_an_environment_flies_another_drone_by_one_word(name: str) -> None:
    """Changing the driver alone gives a valid environment."""
    content = json.loads(environment_of(name).model_dump_json(by_alias=True))
    for robot in content["robots"]:
        robot["driver"] = "tello"
    assert EnvironmentConfig.model_validate(content).robots[0].driver == "tello"
