"""Chases in simulation repeat by seed and reach the aims; tuning never makes things worse."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from aerodaas.analytics.follow.followers import VipFollowAnalytics
from aerodaas.errors import ConfigError
from aerodaas.following.follow_settings import FollowGains
from aerodaas.simulation.scenario import Scenario
from aerodaas.simulation.world import World
from tools.tuning.__main__ import app
from tools.tuning.chase import TELLO, Chase, ChaseResult
from tools.tuning.perception import TruthPerception
from tools.tuning.search import FollowTask, tune_follow
from tools.tuning.walk import PERSON, walk


def chase(speed: float, duration: float, seed: int = 3) -> ChaseResult:
    """One flight by true boxes."""
    person = walk(speed, duration, seed).thing(PERSON)
    eyes = TruthPerception(person, "vest", TELLO, seed=seed)
    return Chase(person, seed=seed).fly(VipFollowAnalytics(), eyes, duration)


def test_a_walk_is_followed_within_the_aims() -> None:
    """Wind, sensor noise, noisy boxes and latency: distance, height and view are held."""
    flown = chase(0.7, 35.0).after(12.0)
    assert flown.within(2.0, 0.3) >= 0.95
    assert flown.at_height(1.5, 0.1) == 1.0
    assert flown.in_view.mean() >= 0.99


@pytest.mark.parametrize("seed", [0, 3, 4])
@pytest.mark.parametrize(
    ("rate", "latency", "nearest"), [(10.0, 0.15, 0.5), (5.0, 0.25, 0.3)], ids=["10 Hz", "5 Hz"]
)
def test_nobody_who_walks_up_to_the_drone_reaches_it(
    rate: float, latency: float, nearest: float, seed: int
) -> None:
    """It backs off as fast as people walk, and goes on where they are too near to be seen."""
    way = {"points": [(3.0, 0.0), (-12.0, 0.0)], "speed": 1.3, "start": 8.0, "end": "stop"}
    walker = {"kind": "person", "id": PERSON, "vest": "any", "at": (3.0, 0.0), "motion": way}
    world = World(Scenario.model_validate({"name": "meeting", "entities": [walker]}), seed)
    person = world.thing(PERSON)
    eyes = TruthPerception(person, "vest", TELLO, seed=seed)
    chase = Chase(person, rate=rate, latency=latency, seed=seed)
    flown = chase.fly(VipFollowAnalytics(), eyes, 22.0)
    assert flown.person[-1, 0] < -10.0
    assert flown.distance.min() > nearest


def test_the_same_seed_flies_the_same() -> None:
    """To the last digit; another seed does not."""
    one, two, other = chase(0.5, 14.0), chase(0.5, 14.0), chase(0.5, 14.0, seed=4)
    assert np.array_equal(one.place, two.place)
    assert not np.array_equal(one.place, other.place)


@pytest.mark.slow
def test_bad_gains_are_mended() -> None:
    """From sluggish gains, a few trials find better ones on walks that the search has not seen."""
    task = FollowTask(speeds=(1.0,), duration=24.0, rate=5.0)
    slow = FollowGains(distance=(0.2, 0.0, 0.0), yaw=(0.5, 0.0, 0.0), height=0.3)
    told: list[int] = []
    tuned = tune_follow(task, trials=5, start=slow, progress=lambda done, _: told.append(done))
    assert told == [1, 2, 3, 4, 5]
    assert tuned.cost_after <= tuned.cost_before
    assert tuned.better == (tuned.cost_after < tuned.cost_before)


def test_the_command_prints_what_to_paste(tmp_path: Path) -> None:
    """And draws a picture."""
    picture = tmp_path / "tune.png"
    words = ["--trials", "1", "--duration", "13", "--rate", "5"]
    result = CliRunner().invoke(app, [*words, "--speeds", "0.5", "--plot", str(picture)])
    assert result.exit_code == 0, result.output
    assert "FollowGains(" in result.output or "keep them" in result.output
    assert picture.stat().st_size > 10_000


@pytest.mark.parametrize(
    "words",
    [{"rate": 0.0}, {"latency": 2.0}, {"speeds": ()}, {"speeds": (9.0,)}, {"duration": 5.0}],
)
def test_tasks_that_cannot_be_are_refused(words: dict[str, object]) -> None:
    """Before anything flies."""
    with pytest.raises(ConfigError):
        FollowTask(**words)  # type: ignore[arg-type]
