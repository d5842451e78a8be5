"""Classes of a stranger's own that come into being in flight, analyse and steer it."""

from __future__ import annotations

from pathlib import Path

import pytest
from stranger import HEAD, fly, write

APPLICATION = (
    HEAD
    + """
drone.navigate(AeroListData([Waypoint("a", 2, 0, 2, hover_duration=60), Waypoint("b", 2, 2, 2)]))
drone.start_mission(wait=False)

from dataclasses import dataclass
from aerodaas import AeroNavigation, NavigationType
import tones


class Toning(Analytics[tones.Tone]):
    isolated = True

    def process(self, item, context):
        return tones.Tone(Depth(float(item.image.mean())))


class Depth:
    def __init__(self, value):
        self.value = value


toned = Toning().deploy(edge).analyse(camera)


@dataclass
class Steered:
    depth: object


class Judge(Analytics[Steered]):
    isolated = True

    def process(self, item, context):
        assert isinstance(item, tones.Tone), type(item)
        assert isinstance(item.depth, Depth), type(item.depth)
        return Steered(item.depth)


class Steer(Analytics[AeroNavigation]):  # the brackets say what it produces
    been = False

    def process(self, item, context):
        assert isinstance(item, Steered)
        assert isinstance(item.depth, Depth)
        # It runs before the drone listens to it, so it says it until the drone has been there.
        east, north, _ = context.vehicle().odometry.position
        self.been = self.been or max(abs(east - 1), abs(north - 1)) < 0.25
        if not self.been:
            late = Waypoint("late", 1, 1, 2, priority=0)
            return AeroNavigation(NavigationType.DISTANCE_DRIVEN, [late])


judged = Judge().deploy(edge).analyse(toned)
drone.navigate(Steer().deploy(edge).analyse(judged))
first = judged.get_data(timeout=20)
assert isinstance(first, Steered), first
print("read", type(first.depth).__name__)
drone.wait()
"""
)
TONES = """
class Tone:
    def __init__(self, depth):
        self.depth = depth
"""


@pytest.mark.parametrize(
    "speed", ["max", pytest.param("2", marks=pytest.mark.slow)], ids=["simulated time", "real time"]
)
def test_classes_made_in_flight_reach_all_that_starts_and_all_that_runs(
    tmp_path: Path, speed: str
) -> None:
    """Three growths, each with classes of its own; what the first defined is read by the last."""
    write(tmp_path, {"app.py": APPLICATION, "tones.py": TONES})
    flown = fly(tmp_path, "app.py", "--speed", speed)
    assert flown.code == 0, flown.said
    assert "read Depth" in flown.said, flown.said
    assert "3 of 3 waypoints" in flown.said, flown.said
    assert flown.alerts() == []
    assert {kind for kind, _ in flown.values("drone/judge")} == {"Steered"}
