"""Flights over things that no map has, by a simulated rangefinder, judged by the truth."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from flying import FLAT, Flyer, recorded, robot

from aerodaas import AeroNavigation, Environment, Waypoint
from aerodaas.recording.reader import Recording
from aerodaas.recording.states import vehicle_states

_HALL = {
    "kind": "building",
    "id": "hall",
    "at": [20, 0],
    "yaw": 0,
    "size": [16, 12, 6],
    "roof": "flat",
}
_CLEARANCE = 3.0


@pytest.mark.wall_clock
def test_a_drone_keeps_its_clearance_over_a_roof(flyer: Flyer) -> None:
    """Sent across 7 m high, over a flat roof of 6 m: it climbs over it, and back down behind."""

    def build(environment: Environment) -> None:
        drone = environment.get_robot_by_id("drone")
        drone.navigate(AeroNavigation(data=[Waypoint("across", 45, 0, 7.0)]))

    world = flyer.folder / "yard.json"
    scenario = {"name": "yard", "description": "A yard.", "entities": [_HALL]}
    world.write_text(json.dumps(scenario))
    limits = {"rangefinder_clearance": _CLEARANCE, "takeoff_height": 7.0, "cruise_speed": 1.0}
    content: dict[str, Any] = {
        **FLAT,
        "robots": [{**robot(), "limits": limits}],
        "simulation": {"world": str(world)},
    }
    run = flyer.fly(build, content, lockstep=True)
    drone = recorded(run).robots["drone"]
    assert drone.visited == ("across",)
    assert run.recording is not None
    with Recording.open(run.recording) as recording:
        states = [state for _, state in vehicle_states(recording, "drone")]
    over = [one for one in states if one.truth and 15.0 < one.truth.position[0] < 27.0]
    heights = np.array([one.truth.position[2] for one in over if one.truth])
    assert heights.min() > 6.0 + _CLEARANCE - 0.6
    below = np.array([np.nan if one.below is None else one.below for one in over])
    assert np.abs(below - (heights - 6.0)).max() < 0.3
    behind = [one.truth.position[2] for one in states if one.truth and one.truth.position[0] > 44.5]
    assert min(behind) < 7.5
