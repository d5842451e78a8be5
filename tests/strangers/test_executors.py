"""A stranger's classes in an executor of the cloud, and in processes that Ray has to restart."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from stranger import CAMERA, ENVIRONMENT, HEAD, Flown, fly, write

pytestmark = pytest.mark.slow

ORCHARD = (
    HEAD
    + '''
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerodaas.cameras.base import Picture
from aerodaas.schedulers.analytics.published.cloud_only import CloudOnly
from fruit import Crate

HERE = str(Path(__file__).parent)


class Rows:
    """A camera that shows rows."""

    model, finished, skipped = None, False, 0

    def __init__(self, sensor, environment):
        self.rows = sensor.settings["rows"]

    def open(self): ...
    def close(self): ...

    def capture(self, stamp, pose):
        image = np.zeros((48, 64, 3), np.uint8)
        image[:: self.rows] = 200
        return Picture(image, stamp)


class Faraway(CloudOnly):
    pass


@dataclass
class Count:
    crates: list
    where: "Place"


class Place:
    def __init__(self, kind):
        self.kind = kind


def die_once(name, number):
    """As a library does that runs into its own limits; only once, whichever process it is."""
    mark = Path(HERE) / name
    if number > 12 and not mark.exists():
        mark.touch()
        os._exit(3)


class Counting(Analytics[Count]):
    scheduled = True

    def process(self, item, context):
        die_once("counting", item.header.id)
        return Count([Crate(int(item.image.max()))], Place(context.kind))


class Sleeper(Analytics[str]):
    isolated = True

    def process(self, item, context):
        assert isinstance(item, Count), type(item)
        return f"{isinstance(item.crates[0], Crate)} {isinstance(item.where, Place)}"


class Fragile(Analytics[Place]):
    isolated = True

    def process(self, item, context):
        die_once("fragile", item.header.id)
        return Place("fragile")


class Reader(Analytics[str]):
    isolated = True

    def process(self, item, context):
        die_once("reader", item.header.id if hasattr(item, "header") else 20)
        return f"{isinstance(item, Place)} {item.kind}"


def many(count):
    return isinstance(count, Count) and isinstance(count.crates[0], Crate)


cloud = env.get_compute_resource_by_id("cloud")
env.set_analytics_scheduler(Faraway())
counting = Counting().deploy(cloud)
sleeper = Sleeper().deploy(edge)
sleeper.analyse(counting.analyse(camera))
counting.trigger(sleeper, when=many)
Reader().deploy(edge).analyse(Fragile().deploy(edge).analyse(camera))
hover = Waypoint("a", 2, 0, 2, hover_duration=40)
drone.navigate(AeroListData([hover, Waypoint("b", 2, 2, 2)]))
drone.start_mission()
'''
)
FRUIT = """
from dataclasses import dataclass


@dataclass
class Crate:
    apples: int
"""


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    """One flight in real time, in which three processes end."""
    folder = tmp_path_factory.mktemp("orchard")
    environment = json.loads(json.dumps(ENVIRONMENT))
    rows = {**CAMERA, "driver": "orchard:Rows", "settings": {"rows": 4}}
    environment["robots"][0]["sensors"] = [rows]
    environment["compute"].append({"id": "cloud", "kind": "cloud", "compression": "png"})
    write(folder, {"orchard.py": ORCHARD, "fruit.py": FRUIT}, environment)
    flown = fly(folder, "orchard.py", "--speed", "2")
    ended = {path.name for path in Path(folder).iterdir()}
    assert ended >= {"counting", "fragile", "reader"}, flown.said
    return flown


def test_the_mission_is_flown_and_the_ends_are_told_by_name(flown: Flown) -> None:
    """Of each process that it ended, and that it is back; of nothing else."""
    assert flown.landed_as_planned(), flown.said
    told = " ".join(flown.alerts())
    for name in ("fragile", "reader"):
        assert f"the actor analytics/drone/{name} died" in told
        assert f"analytics/drone/{name} is back" in told
    assert "cannot read" not in told
    assert "not defined" not in flown.said


def test_results_are_the_applications_own_before_and_after(flown: Flown) -> None:
    """In the cloud's executor, the edge's readers and the recording."""
    counts = flown.values("drone/counting")
    assert {json.dumps(value, sort_keys=True) for _, value in counts} == {
        '{"crates": [{"apples": 200}], "where": {"kind": "cloud"}}'
    }
    assert len(counts) > 30
    assert flown.lines("drone/sleeper") == {"True True"}
    assert flown.lines("drone/reader") == {"True fragile"}


def test_rays_own_words_do_not_reach_the_terminal(flown: Flown) -> None:
    """It has a paragraph for each worker that dies, and advice about its memory."""
    assert "raylet" not in flown.said
    assert "OOM" not in flown.said
