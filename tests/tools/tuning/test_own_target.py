"""A Tello that follows somebody who walks, rests and walks on gives way to nobody."""

from __future__ import annotations

import math

import pytest

from aerodaas.analytics.detection.vip_detection import VipDetectionAnalytics
from aerodaas.analytics.follow.followers import VipFollowAnalytics
from aerodaas.clock import seconds
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.detections import Detections
from aerodaas.messages.odometry import Odometry
from aerodaas.simulation.scenario import load_scenario
from aerodaas.simulation.world import World
from tools.tuning.chase import Chase
from tools.tuning.perception import DetectorPerception

TELLO = CameraModel.from_fov(
    640, 480, math.radians(55.2), mount=(0.035, 0.0, 0.0), pitch=math.radians(12.0)
)
"""The Tello's narrow video, which cuts feet off, tilted as in Situation Awareness."""
SETTLED, DURATION = 12.0, 26.0
"""Seconds until the drone has come up behind the walker, and of the flight; they rest at 23 s."""


@pytest.mark.slow
def test_the_shipped_detectors_loose_boxes_around_the_target_are_nobody_who_comes() -> None:
    """As in Situation Awareness: the drone stays behind the walker and gives way to nobody."""
    world = World(load_scenario("campus"), 0)
    walker = world.thing("vip")
    eyes = DetectorPerception(world, TELLO, VipDetectionAnalytics(threads=1))
    chase = Chase(walker, "vest", 10.0, 0.2, camera=TELLO, wind=(0.3, 0.2, 0.0), gust=0.2)
    follow = VipFollowAnalytics(distance=2.0)
    wrong: list[float] = []

    def watch(boxes: Detections, pose: Odometry) -> None:
        """Whether the guard believes the target where it is."""
        stamp = boxes.header.stamp
        state = walker.state(seconds(stamp))
        true = math.dist((state.x, state.y), pose.position[:2])
        people = follow.controller.guard._people.relative_to(pose, stamp)
        believed = [one.place.distance for one in people if one.followed]
        if seconds(stamp) > SETTLED and believed != pytest.approx([true], abs=0.8):
            wrong.append(seconds(stamp))

    flown = chase.fly(follow, eyes, DURATION, watch=watch)
    eyes.close()
    assert wrong == []
    settled = flown.after(SETTLED)
    assert "person_close" not in flown.alerts
    assert settled.within(2.0, 0.5) > 0.8
    assert 1.0 < settled.distance.min() <= settled.distance.max() < 3.0
