"""Scripted answers to the tasks of agents: solutions pass, and near misses fail as they should."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "benchmarks"))

from agent_tasks.criteria import (  # noqa: E402 - benchmarks are no package
    ALWAYS,
    arrivals,
    none_given_up,
    outside,
    stays,
)
from agent_tasks.tasks import TASKS  # noqa: E402
from agents import judge, judge_answers, pass_interval  # noqa: E402
from missions.evidence import Evidence  # noqa: E402

from aerodaas.config.model import GeofenceConfig, LimitsConfig, RobotConfig  # noqa: E402
from aerodaas.errors import UnknownIdError  # noqa: E402
from aerodaas.recording.report.flight import RecordedFlight, RobotFlight  # noqa: E402
from aerodaas.simulation.scenario import Scenario  # noqa: E402
from aerodaas.simulation.world import World  # noqa: E402

QUICK = ("N1", "N3", "N5", "N15")


@pytest.mark.parametrize(
    "name",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in TASKS],
)
@pytest.mark.timeout(900)
def test_a_solution_passes_and_a_near_miss_fails(name: str, tmp_path: Path) -> None:
    """All checks of the one; of the other exactly those that its mistake names."""
    result = judge(TASKS[name], tmp_path)
    assert not result.solution
    assert result.miss
    assert result.as_expected, result.miss


def test_a_models_answers_are_judged_like_the_scripted_ones(tmp_path: Path) -> None:
    """One passes, one fails at the corners that it mirrors, and one cannot be flown."""
    answers = tmp_path / "answers"
    answers.mkdir()
    task = TASKS["N1"]
    (answers / "N1-a.json").write_text(task.solution().text())
    (answers / "N1-b.json").write_text(task.miss().text())
    (answers / "N1-c.json").write_text("{}")
    judged = list(judge_answers(sorted(answers.iterdir()), tmp_path / "flown"))
    assert [bool(answer.failed) for answer in judged] == [False, True, True]
    with pytest.raises(UnknownIdError):
        list(judge_answers([tmp_path / "N99-a.json"], tmp_path))


@pytest.mark.parametrize(
    ("passed", "tried", "low", "high"),
    [(0, 10, 0.0, 0.278), (10, 10, 0.722, 1.0), (20, 25, 0.609, 0.911)],
)
def test_an_interval_is_wilsons(passed: int, tried: int, low: float, high: float) -> None:
    """Values of published tables."""
    assert pass_interval(passed, tried) == pytest.approx((low, high), abs=0.001)


def test_each_task_is_asked_and_judged() -> None:
    """25 tasks, each with a truth of its own and with what holds for every flight."""
    assert len(TASKS) == 25
    for task in TASKS.values():
        assert task.request
        assert task.truth
        assert task.fails
        assert task.networks or task.always == ALWAYS


def flown(seconds: list[float], east: list[float]) -> Evidence:
    """A flight along the east, two metres up, by its moments and places."""
    time = np.arange(seconds[0], seconds[-1] + 0.05, 0.05)
    x = np.interp(time, seconds, east)
    position = np.stack([x, np.zeros_like(x), np.full_like(x, 2.0)], -1)
    fence = GeofenceConfig(ceiling=10)
    config = RobotConfig(id="drone", limits=LimitsConfig(geofence=fence))
    world = World(Scenario.model_validate({"name": "test", "entities": []}))
    velocity = np.gradient(position, time, axis=0)
    robot = RobotFlight()
    return Evidence(RecordedFlight(), robot, config, world, time, position, velocity)


def test_an_area_is_entered_only_where_the_way_leads() -> None:
    """The way ends at 10 m east."""
    flight = flown([0, 10], [0, 10])
    assert outside([(11, -1), (12, -1), (12, 1), (11, 1)])(flight).holds
    assert not outside([(4, -1), (6, -1), (6, 1), (4, 1)])(flight).holds


def test_passing_by_is_no_stay() -> None:
    """A drone that flies through a place is there, and stays nowhere."""
    place = (5.0, 0.0, 2.0)
    passing, staying = flown([0, 10], [0, 10]), flown([0, 5, 9, 14], [0, 5, 5, 10])
    assert arrivals((place, 0.0, 6.0))(passing).holds
    assert not arrivals((place, 0.0, 4.0))(passing).holds
    assert not stays(place, seconds=(3, 5))(passing).holds
    assert stays(place, seconds=(3, 5))(staying).holds
    assert not stays(place, seconds=(5, 9))(staying).holds


def test_a_waypoint_that_was_given_up_is_a_failure() -> None:
    """Whatever else the flight did."""
    flight = flown([0, 10], [0, 10])
    given_up = replace(flight, robot=replace(flight.robot, given_up=("wp3",)))
    assert none_given_up(flight).holds
    assert not none_given_up(given_up).holds
