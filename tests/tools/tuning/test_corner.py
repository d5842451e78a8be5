"""A follower with a depth camera stops before a corner along which it sees its target."""

from __future__ import annotations

import numpy as np
import pytest

from aerodaas.analytics.base import Context
from aerodaas.analytics.follow.followers import VipFollowAnalytics
from aerodaas.clock import seconds
from aerodaas.messages.detections import Detections
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.odometry import Odometry
from aerodaas.simulation.renderer import renderer_for
from aerodaas.simulation.scenario import Scenario
from aerodaas.simulation.world import World
from tools.tuning.chase import TELLO, Chase, ChaseResult
from tools.tuning.perception import TruthPerception

WEST, EAST = 4.0, 8.0
"""Of the cabin, metres."""


def world(edge: float) -> World:
    """Somebody stands 12 m to the east; a cabin reaches from the north to `edge` metres."""
    cabin = {"kind": "building", "id": "cabin", "at": [6.0, edge + 3.0], "yaw": 0.0}
    person = {"kind": "person", "id": "vip", "vest": "lime", "at": [12.0, 0.0], "yaw": 0.0}
    entities = [{**cabin, "size": [EAST - WEST, 6.0, 4.0], "roof": "flat"}, person]
    return World(Scenario.model_validate({"name": "corner", "entities": entities}), 0)


class MeasuringEyes:
    """True boxes, beside rendered depth up to so many metres, if any."""

    def __init__(self, of: World, depth_range: float | None) -> None:
        self._truth = TruthPerception(of.thing("vip"), "vest", TELLO, seed=0)
        self._renderer = renderer_for(of, TELLO, depth_range)

    def look(
        self, header: Header, pose: Odometry, believed: Odometry, context: Context
    ) -> Detections:
        """Boxes of a frame with depth."""
        found = self._truth.look(header, pose, believed, context)
        image = self._renderer.render(seconds(header.stamp), pose)
        frame = Frame(header, image, TELLO, believed, self._renderer.depth())
        return Detections.of(frame, found.items)


def fly(edge: float, depth_range: float | None) -> tuple[ChaseResult, float]:
    """Follow for 25 s; the flight, and how near to the cabin the drone came."""
    scene = world(edge)
    eyes = MeasuringEyes(scene, depth_range)
    flown = Chase(scene.thing("vip"), rate=5.0, latency=0.25).fly(VipFollowAnalytics(), eyes, 25.0)
    east, north = flown.place.T
    beside = np.maximum(np.maximum(WEST - east, east - EAST), 0.0)
    return flown, float(np.hypot(beside, np.maximum(edge - north, 0.0)).min())


@pytest.mark.parametrize("edge", [0.2, 0.4])
def test_it_waits_before_a_corner_in_its_way(edge: float) -> None:
    """Without depth it flies along the wall, near enough to touch it in a gust."""
    blind, touched = fly(edge, None)
    assert touched < edge + 0.05
    assert abs(blind.distance[-1] - 2.0) < 0.3
    seeing, nearest = fly(edge, 10.0)
    assert nearest > 0.5
    assert seeing.distance[-1] > 7.0
    assert seeing.alerts == ["way_blocked"]


def test_it_goes_by_a_corner_beside_its_way() -> None:
    """0.7 m are room enough."""
    flown, nearest = fly(0.7, 10.0)
    assert nearest > 0.6
    assert abs(flown.distance[-1] - 2.0) < 0.3
    assert flown.alerts == []
