"""Flights over things that no map has, by a simulated rangefinder, judged by the truth."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from flying import FLAT, Flyer, recorded, robot

from aerodaas import AeroNavigation, Environment, SchedulingType, Waypoint
from aerodaas.environment.run import Run
from aerodaas.errors import IncompleteError
from aerodaas.recording.reader import Recording, vehicle_states
from aerodaas.recording.report.flight import RecordedFlight

_HALL = {
    "kind": "building",
    "id": "hall",
    "at": [20, 0],
    "yaw": 0,
    "size": [16, 12, 6],
    "roof": "flat",
}
_CLEARANCE = 3.0


def _flown_over_the_hall(
    flyer: Flyer, build: Callable[[Environment], None], **mission: object
) -> Run:
    """A flight in a yard with a hall of 6 m; the drone keeps 3 m above what is below it."""
    world = flyer.folder / "yard.json"
    scenario = {"name": "yard", "description": "A yard.", "entities": [_HALL]}
    world.write_text(json.dumps(scenario))
    limits = {"rangefinder_clearance": _CLEARANCE, "takeoff_height": 7.0, "cruise_speed": 1.0}
    content: dict[str, Any] = {
        **FLAT,
        "robots": [{**robot(), "limits": limits, "mission": mission}],
        "simulation": {"world": str(world)},
    }
    return flyer.fly(build, content, simulated_time=True)


@pytest.mark.wall_clock
def test_a_drone_keeps_its_clearance_over_a_roof(flyer: Flyer) -> None:
    """Sent across 7 m high, over a flat roof of 6 m: it climbs over it, and back down behind."""

    def build(environment: Environment) -> None:
        drone = environment.get_robot_by_id("drone")
        drone.navigate(AeroNavigation(data=[Waypoint("across", 45, 0, 7.0)]))

    run = _flown_over_the_hall(flyer, build)
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


@pytest.mark.wall_clock
def test_a_place_that_is_too_low_over_a_roof_is_given_up_for_the_clearance(flyer: Flyer) -> None:
    """Two metres above the roof of 6 m, where three are kept: told so, and the next is visited."""

    def build(environment: Environment) -> None:
        drone = environment.get_robot_by_id("drone")
        stops = [Waypoint("low", 20, 0, 8.0), Waypoint("behind", 35, 0, 7.0)]
        drone.navigate(AeroNavigation(data=stops, scheduling_type=SchedulingType.ORDERED))

    with pytest.raises(IncompleteError, match="low cannot be reached"):
        _flown_over_the_hall(flyer, build, stall_timeout=5.0)
    with Recording.open(flyer.folder / "flight" / "flight.mcap") as recording:
        flight = RecordedFlight.read(recording)
    assert flight.robots["drone"].visited == ("behind",)
    (text,) = [text for _, _, text in flight.alerts if "low" in text]
    assert text == (
        "low cannot be reached: the drone comes no nearer, for it stays 3 m above what is below it "
        "(limits.rangefinder_clearance)"
    )
