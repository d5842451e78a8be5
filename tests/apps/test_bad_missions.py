"""Missions that cannot succeed end in a stated, safe way, and their reports say what happened."""

from __future__ import annotations

import json
import runpy
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import Flyer
from onnx import TensorProto, helper, numpy_helper, save

from aerodaas.errors import AeroDaaSError, ConfigError, MissionError
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight, RobotFlight
from aerodaas.recording.report.report import write_report

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "benchmarks"))

from missions.catalogue import MISSIONS  # noqa: E402 - benchmarks are no package

FAST = {"max_speed": 4.0, "cruise_speed": 3.0}


def fly(flyer: Flyer, name: str, settings: dict[str, Any], **words: Any) -> None:  # noqa: ANN401
    """Run an application's own file to its end, with settings laid over its environment.

    Five pictures a second show it the same as fifteen do.
    """
    application = MISSIONS[name].application
    overrides = {"cam1.rate": 5, **settings}
    with flyer.options(application=application, overrides=overrides, seed=0, **words):
        runpy.run_path(str(application), run_name="__main__")


def outcome(flyer: Flyer) -> tuple[RobotFlight, str]:
    """The only robot's flight, and what the report says in words."""
    path = flyer.folder / "flight" / "flight.mcap"
    with Recording.open(path) as recording:
        assert recording.complete
        (robot,) = RecordedFlight.read(recording).robots.values()
    report = write_report(path, flyer.folder / "report")
    return robot, report.summary_text.read_text()


def blind_model(path: Path) -> Path:
    """A detector that is never sure of anything."""
    found = np.full((1, 8, 84), 32.0, np.float32)
    found[:, 4:] = 0.01
    constant = numpy_helper.from_array(found, "constant")
    graph = helper.make_graph(
        [helper.make_node("Identity", ["constant"], ["output0"])],
        "blind",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, 64, 64])],
        [helper.make_tensor_value_info("output0", TensorProto.FLOAT, [1, 8, 84])],
        [constant],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    names = {0: "vest", 1: "person", 2: "car", 3: "tower"}
    helper.set_model_props(model, {"names": str(names), "task": "detect", "stride": "32"})
    save(model, str(path))
    return path


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("{", "not JSON"),
        (json.dumps({"name": "x", "entities": [{"kind": "dragon", "id": "a"}]}), "entities.0"),
        (None, "no world is called"),
    ],
)
def test_a_broken_world_is_told_before_anything_starts(
    tmp_path: Path, content: str | None, told: str
) -> None:
    """The file and the place in it are named; neither Ray nor a recording is begun."""
    flyer = Flyer(tmp_path)
    world = flyer.folder / "world.json"
    if content is not None:
        world.write_text(content)
    with pytest.raises(ConfigError, match=f"(?s){told}") as error:
        fly(flyer, "farm_survey", {"simulation.world": str(world)})
    assert "world.json" in str(error.value)
    assert not (flyer.folder / "flight").exists()


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_model_that_misses_ends_a_search_at_home(flyer: Flyer) -> None:
    """All four waypoints are searched, nobody is found, and the drone comes home and says so."""
    fast = {f"tello.limits.{name}": value for name, value in FAST.items()}
    fly(flyer, "search_and_rescue", fast, model=blind_model(flyer.folder / "blind.onnx"))
    robot, report = outcome(flyer)
    assert robot.visited == ("wp1", "wp2", "wp3", "wp4")
    assert "following" not in [band.state for band in robot.bands]
    assert robot.outcome == "landed: navigation has been silent for " + robot.outcome[-4:]
    assert np.linalg.norm(robot.position[-1]) < 1.0
    assert "4 of 4 waypoints" in report
    assert "navigation has been silent" in report


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_person_who_never_comes_is_waited_for_in_vain(flyer: Flyer) -> None:
    """Nobody is on the meadow: the drone holds, then lands where it took off."""
    fly(flyer, "situation_awareness", {"simulation.world": "empty"})
    robot, report = outcome(flyer)
    assert "following" not in [band.state for band in robot.bands]
    holding = next(band for band in robot.bands if band.state == "holding")
    assert 30.0 < holding.end - holding.start < 40.0, "silence_return of the environment"
    assert robot.outcome.startswith("landed: navigation has been silent")
    assert np.linalg.norm(robot.position[-1]) < 1.0
    assert "navigation has been silent" in report


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_battery_too_small_for_the_mission_brings_it_home(flyer: Flyer) -> None:
    """It says beforehand that the plan is too long, flies what it can, and returns in time."""
    battery = {"quadrotor_base.battery": 0.3, "quadrotor_base.limits.battery_return": 0.27}
    with pytest.raises(MissionError, match="not completed: the battery is low"):
        fly(flyer, "farm_survey", battery)
    robot, report = outcome(flyer)
    assert 0 < len(robot.visited) < 4
    assert "battery" in robot.outcome
    assert robot.outcome.startswith("landed")
    assert np.linalg.norm(robot.position[-1]) < 1.0
    assert "battery" in report


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_an_empty_battery_refuses_take_off(flyer: Flyer) -> None:
    """Nothing moves; the application ends with the reason, and so does the report."""
    with pytest.raises(MissionError, match="battery") as error:
        fly(flyer, "farm_survey", {"quadrotor_base.battery": 0.1})
    assert isinstance(error.value, AeroDaaSError)
    robot, report = outcome(flyer)
    assert robot.position[:, 2].max() < 0.1
    assert robot.outcome.startswith("aborted")
    assert "battery" in report
