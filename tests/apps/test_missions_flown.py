"""Each application's main() flies in its own world and meets the criteria of its mission."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

from missions.catalogue import MISSIONS
from missions.figures import Figures
from missions.flying import fly

SEED = 0
SLOWEST = 1800
SURVEYS = ("disaster_survey", "farm_survey", "tower_inspection", "vehicle_tracking")
RATES = dict.fromkeys(SURVEYS, 5)
"""Pictures a second where fewer than the environment's fifteen fly the same mission, for a third of
the detector's time. `benchmarks/paper.py` flies them as they ship."""

pytestmark = [pytest.mark.slow, pytest.mark.timeout(SLOWEST)]


@pytest.mark.parametrize("name", sorted(MISSIONS))
def test_the_mission_meets_its_criteria(name: str, tmp_path: Path) -> None:
    """By the command line, the remote user being a process of its own."""
    mission = MISSIONS[name]
    settings = {"cam1.rate": RATES[name]} if name in RATES else {}
    flown = fly(mission, SEED, tmp_path, settings=settings, timeout=SLOWEST - 120)
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
