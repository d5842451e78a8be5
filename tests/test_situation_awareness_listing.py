"""The paper's listing 1 flies as printed: by the networks that ship, in the simulated world."""

from __future__ import annotations

import json
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import Flyer

from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.simulation.scenario import Scenario
from aerodaas.simulation.world import World

LISTING = Path(__file__).parent / "listings" / "situation_awareness.py"
RAISED = 34.0
"""Seconds of mission time at which the person raises a hand."""
SCENARIO: dict[str, Any] = {
    "name": "walk",
    "entities": [
        {
            "kind": "person",
            "id": "vip",
            "vest": "yellow",
            "motion": {
                "points": [[3, 0], [12, 0], [16, 4], [20, 4]],
                "speed": 0.5,
                "start": 6,
                "end": "vanish",  # a hand that nobody notices must not keep the drone up for ever
            },
            "gestures": [{"kind": "hand_raised", "start": RAISED}],
        },
        {"kind": "building", "id": "hall", "at": [40, 6], "yaw": 80},
    ],
}
ENVIRONMENT: dict[str, Any] = {
    "name": "listing",
    "robots": [
        {
            "id": "tello",
            "limits": {"max_speed": 2.0, "takeoff_height": 1.5, "silence_return": 20},
            "sensors": [
                {
                    "id": "tello_cam1",
                    "type": "camera",
                    "rate": 5,
                    "settings": {"width": 640, "height": 360},
                },
                {"id": "odom", "type": "odometry", "rate": 10},
            ],
        }
    ],
    "compute": [{"id": "edge_cloud", "kind": "edge"}],
}


@pytest.mark.slow
def test_situation_awareness_flies_as_printed(flyer: Flyer) -> None:
    """The drone keeps two metres from the person, and lands once a hand is raised."""
    scenario = flyer.folder / "walk.json"
    scenario.write_text(json.dumps(SCENARIO))
    environment = flyer.write({**ENVIRONMENT, "simulation": {"world": str(scenario), "seed": 3}})
    with flyer.options(application=LISTING, environment=environment):
        runpy.run_path(str(LISTING), run_name="__main__")
    with Recording.open(flyer.folder / "flight" / "flight.mcap") as recording:
        assert recording.complete
        flight = RecordedFlight.read(recording)
    drone = flight.robots["tello"]
    assert drone.outcome.startswith("landed")
    vip = World(Scenario.model_validate(SCENARIO), seed=3).thing("vip")
    held = (drone.time > 14.0) & (drone.time < RAISED)
    places = np.array([(vip.state(time).x, vip.state(time).y) for time in drone.time[held]])
    distance = np.hypot(*(drone.position[held, :2] - places).T)
    assert np.mean(np.abs(distance - 2.0) <= 0.3) > 0.9
    raised = [time for time, kind, _ in flight.alerts if kind == "hand_raised"]
    assert len(raised) == 1
    assert RAISED < raised[0] < RAISED + 4.0
    landing = next(band for band in drone.bands if band.state == "landing")
    assert raised[0] - 0.5 <= landing.start < raised[0] + 1.0
