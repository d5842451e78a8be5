"""Schedulers, cameras, conditions and sources of a stranger's own, wherever they lie."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from stranger import CAMERA, ENVIRONMENT, FLY, HEAD, Flown, fly, write

pytestmark = pytest.mark.slow

APPLICATION = """
import importlib
import sys
from pathlib import Path

import numpy as np

from aerodaas import TrajectoryScheduler
from aerodaas.cameras.base import Picture
from aerodaas.schedulers.analytics.published.edge_only import Fifo

sys.path.insert(0, str(Path(__file__).parent / "plug_ins"))


class Stripes:
    model, finished, skipped = None, False, 0

    def __init__(self, sensor, environment):
        self.light = int(sensor.settings.get("light", 100))

    def open(self): ...
    def close(self): ...

    def capture(self, stamp, pose):
        return Picture(np.full((32, 48, 3), self.light, np.uint8), stamp)


class Farthest(TrajectoryScheduler):
    def plan(self, pending, situation):
        far = lambda stop: -np.linalg.norm(stop.position - situation.position)
        return sorted(pending, key=far)


class Patient(Fifo):
    pass


class Reading:
    def __init__(self, value):
        self.value = value


class Measure(Analytics[Reading]):
    scheduled = True

    def process(self, item, context):
        return Reading(float(item.image.mean()))


class Woken(Analytics[Reading]):
    def process(self, item, context):
        return Reading(-item.value)


class Tick(Analytics[Reading]):
    rate = 2.0

    def process(self, item, context):
        return Reading(context.now() / 1e9)


def above(limit):
    return lambda reading: isinstance(reading, Reading) and reading.value > limit


env.set_trajectory_scheduler(Farthest())
env.set_analytics_scheduler(Patient())
plugged = importlib.import_module("plugged")
measure = Measure().deploy(edge)
readings = measure.analyse(camera)
woken = Woken().deploy(edge)
woken.analyse(readings)
measure.trigger(woken, when=above(99.0))
Tick().deploy(edge).instantiate()
plugged.Squared().deploy(edge).analyse(readings)
scheduler = env.trajectory_scheduler()
drone.navigate(scheduler.generate_navigation(
    AeroListData([Waypoint("near", 1, 0, 2), Waypoint("far", 3, 0, 2)])
))
drone.start_mission()
"""
PLUGGED = """
from aerodaas import Analytics
from plugged_results import Square


class Squared(Analytics[Square]):
    isolated = True

    def process(self, item, context):
        from plugged_later import square
        return Square(square(item.value), type(item).__name__)
"""
RESULTS = """
from dataclasses import dataclass


@dataclass(slots=True)
class Square:
    value: float
    of: str
"""


def environment(**camera: Any) -> dict[str, Any]:  # noqa: ANN401
    """The usual one, with another camera."""
    content: dict[str, Any] = json.loads(json.dumps(ENVIRONMENT))
    content["robots"][0]["sensors"] = [{**CAMERA, **camera}]
    return content


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    """One flight in simulated time with plug-ins of every kind that it has."""
    folder = tmp_path_factory.mktemp("plugins")
    write(
        folder,
        {
            "all_of_them.py": HEAD + APPLICATION,
            "plug_ins/plugged.py": PLUGGED,
            "plug_ins/plugged_results.py": RESULTS,
            "plug_ins/plugged_later.py": "def square(value):\n    return value * value\n",
        },
        environment(driver="all_of_them:Stripes", settings={"light": 120}),
    )
    return fly(folder, "all_of_them.py")


def test_all_of_them_fly(flown: Flown) -> None:
    """The mission is flown as planned, by the application's own order of waypoints."""
    assert flown.code == 0, flown.said
    assert flown.landed_as_planned(), flown.said
    assert flown.alerts() == []


@pytest.mark.parametrize(
    ("stream", "expected"),
    [
        ("drone/measure", ("Reading", {"value": 120.0})),
        ("drone/woken", ("Reading", {"value": -120.0})),
        ("drone/squared", ("Square", {"value": 14400.0, "of": "Reading"})),
    ],
    ids=["camera and scheduler", "condition", "plug-in folder"],
)
def test_what_they_made_is_recorded(
    flown: Flown, stream: str, expected: tuple[str, object]
) -> None:
    """Each did its work in its own process, with classes of its own."""
    values = flown.values(stream)
    assert len(values) > 10
    assert all(one == expected for one in values)


def test_an_external_source_ticks(flown: Flown) -> None:
    """A source without input, twice a second."""
    values = [one["value"] for _, one in flown.values("tick")]
    assert values[:3] == [0.0, 0.5, 1.0] or values[:3] == [0.5, 1.0, 1.5]


MODULE = (
    """
from __future__ import annotations

from typing import TYPE_CHECKING

from .results import Shade

if TYPE_CHECKING:
    from .app import main
"""
    + HEAD
    + """

class Shading(Analytics[Shade]):
    def process(self, item, context):
        from . import later
        return Shade(later.shade(item), Tone(1))


class Tone:
    def __init__(self, level):
        self.level = level


class Check(Analytics[str]):
    isolated = True

    def process(self, item, context):
        return f"{isinstance(item, Shade)} {isinstance(item.tone, Tone)} {item.value}"


def main():
    Check().deploy(edge).analyse(Shading().deploy(edge).analyse(camera))
"""
    + FLY.replace("\n", "\n    ")
    + """

if __name__ == "__main__":
    main()
"""
)


def test_an_application_that_is_a_module_of_a_package(tmp_path: Path) -> None:
    """`python -m pkg.app`, with relative imports, one of them only in flight."""
    write(
        tmp_path,
        {
            "pkg/__init__.py": "",
            "pkg/app.py": MODULE,
            "pkg/results.py": (
                "from dataclasses import dataclass\n"
                "@dataclass\nclass Shade:\n    value: float\n    tone: object\n"
            ),
            "pkg/later.py": "def shade(item):\n    return 7.0\n",
        },
    )
    flown = fly(tmp_path, "-m", "pkg.app", python=True)
    assert flown.code == 0, flown.said
    shade = {"value": 7.0, "tone": {"level": 1}}
    assert {kind for kind, _ in flown.values("drone/shading")} == {"Shade"}
    assert flown.values("drone/shading")[0][1] == shade
    assert flown.lines("drone/check") == {"True True 7.0"}
