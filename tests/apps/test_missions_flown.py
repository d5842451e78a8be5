"""Each application's main() flies in its own world and meets the criteria of its mission."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from _pytest.mark import ParameterSet

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

from missions.catalogue import MISSIONS
from missions.figures import Figures
from missions.flying import fly

SEED = 0
SLOWEST = 1800

pytestmark = [pytest.mark.slow, pytest.mark.timeout(SLOWEST)]


SHORT = {
    "vehicle_tracking": "the car is seen in too few frames, lost and found again several times",
}
"""What these flights are known to fall short in; nothing else of them is."""


def marked(name: str) -> ParameterSet:
    """The name of a mission, with what it is known to miss."""
    if name not in SHORT:
        return pytest.param(name)
    return pytest.param(name, marks=pytest.mark.xfail(reason=SHORT[name], strict=False))


@pytest.mark.parametrize("name", [marked(name) for name in sorted(MISSIONS)])
def test_the_mission_meets_its_criteria(name: str, tmp_path: Path) -> None:
    """By the command line, the remote user being a process of its own."""
    mission = MISSIONS[name]
    flown = fly(mission, SEED, tmp_path, timeout=SLOWEST - 120)
    assert flown.code == 0, flown.output
    missed = [
        f"{check.what}: {check.found}"
        for check in mission.judge(flown.recording)
        if not check.holds
    ]
    assert not missed, "\n".join(missed)
    figures = Figures.of(mission, flown.recording)
    assert figures.distance > 30
    assert figures.duration < 1.5 * mission.paper.duration
