"""One application flies three drones that share out an area, and keep apart."""

from __future__ import annotations

import runpy
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from flying import Flyer
from required import needs_python

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

from missions.evidence import Evidence

APPLICATION = Path(__file__).parents[2] / "apps" / "fleet_survey.py"
DRONES = ("left", "middle", "right")


@pytest.mark.slow
@pytest.mark.timeout(600)
@needs_python(3, 11, because="PyVRP has no older")
def test_three_drones_share_an_area(flyer: Flyer) -> None:
    """Every waypoint is visited by one of them; all come home, and never near each other."""
    with flyer.options(application=APPLICATION, seed=0):
        runpy.run_path(str(APPLICATION), run_name="__main__")
    recording = flyer.folder / "flight" / "flight.mcap"
    flights = {name: Evidence.read(recording, name) for name in DRONES}
    visits = Counter(place for flight in flights.values() for place in flight.robot.visited)
    assert len(visits) == 20
    assert set(visits.values()) == {1}
    for flight in flights.values():
        assert flight.robot.visited
        assert flight.states[-1] == "landed"
        assert np.linalg.norm((flight.position[-1] - flight.config.start)[:2]) < 1.0
    time = flights["left"].time
    ways = [
        np.column_stack([np.interp(time, one.time, axis) for axis in one.position.T])
        for one in flights.values()
    ]
    gaps = [np.linalg.norm(ways[a] - ways[b], axis=1).min() for a, b in ((0, 1), (1, 2), (0, 2))]
    assert min(gaps) > 1.5
