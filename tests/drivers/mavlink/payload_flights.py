"""Flights and waits for pictures of a MAVLink vehicle."""

from __future__ import annotations

import math
from collections.abc import Callable

from stepped import Stepped
from stepped_missions import started

from aerodaas.config.model import MissionConfig
from aerodaas.mission.mission import Mission
from aerodaas.types.payload import PhotoOutcome
from aerodaas.types.waypoints import Waypoint

__all__ = ["fly", "fly_to", "found", "outcome", "take", "told", "wait"]


def wait(ends: Stepped, condition: Callable[[], object], timeout: float = 15.0) -> None:
    """Turn both ends until `condition` holds."""
    end = ends.now + timeout
    while not condition():
        assert ends.now < end, "waited in vain"
        ends.turn()


def found(ends: Stepped) -> None:
    """Wait for both components, and the gimbal's first word."""
    vehicle = ends.vehicle
    wait(ends, lambda: vehicle.gimbal and vehicle.photo_camera and vehicle.gimbal.attitude)


def outcome(ends: Stepped, timeout: float = 15.0) -> PhotoOutcome:
    """The next word of a picture."""
    said: list[PhotoOutcome] = []

    def look() -> bool:
        camera = ends.vehicle.photo_camera
        assert camera is not None
        said.extend(camera.outcomes())
        return bool(said)

    wait(ends, look, timeout)
    (one,) = said
    return one


def take(ends: Stepped, label: str = "wp1") -> int:
    """Ask for a picture."""
    camera = ends.vehicle.photo_camera
    assert camera is not None
    return camera.take_photo(label)


def fly_to(
    ends: Stepped,
    stops: list[Waypoint],
    options: MissionConfig,
    each: Callable[[Mission], None] = lambda _: None,
) -> Mission:
    """A whole mission to some places; `each` is called at each turn."""
    loop = started(ends, stops, options, ends.vehicle)
    mission = loop.mission
    end = ends.now + 120.0
    while not mission.finished and ends.now < end:
        ends.advance(0.05)
        loop.turn(round(ends.now * 1e9))
        each(mission)
    return mission


def fly(ends: Stepped, each: Callable[[Mission], None] = lambda _: None) -> Mission:
    """A whole mission of two pictures; `each` is called at each turn."""
    stops = [
        Waypoint("a", 3, 0, 2, gimbal_pitch=-math.pi / 2, photo=True),
        Waypoint("b", 3, 3, 2, gimbal_pitch=-0.5, gimbal_yaw=0.7, photo=True),
    ]
    return fly_to(ends, stops, MissionConfig(photo_timeout=4.0), each)


def told(mission: Mission) -> list[str]:
    """What people were told of pictures."""
    return [alert.text for alert in mission.alerts if alert.kind == "photo"]
