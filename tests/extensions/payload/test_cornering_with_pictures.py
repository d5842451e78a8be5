"""Waypoints that are flown through: where the drone stops for gimbal and camera."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flights import add, flight, passed_at

from aerodaas.config.model import GeofenceConfig, LimitsConfig
from aerodaas.geometry.braking import braking_distance
from aerodaas.messages.vehicle import PositionSetpoint
from aerodaas.messages.waypoints import Waypoint

LIMITS = LimitsConfig(cruise_speed=2.0, arrival_radius=0.5)
ROW = [Waypoint(f"w{number}", 10.0 * number, 0.0, 2.0) for number in range(1, 4)]
"""Three on a straight line."""


@pytest.mark.parametrize(
    "change",
    [
        {"photo": True},
        {"gimbal_pitch": -0.5},
        {"zoom": 50.0},
        {"video": False},
    ],
)
def test_a_drone_stops_where_it_has_something_to_do(change: dict[str, Any]) -> None:
    """A picture, the gimbal, the lens, a video."""
    one = flight(add(ROW[0], replace(ROW[1], **change), ROW[2]), limits=LIMITS)
    assert passed_at(one, "w1") > 1.5
    assert passed_at(one, "w2") == 0.0


def test_a_leg_with_pictures_by_distance_begins_and_ends_at_its_places() -> None:
    """Where the first is due, and where the last one is."""
    pictures = replace(ROW[1], trigger_distance=5.0)
    one = flight(add(ROW[0], pictures, ROW[2]), limits=LIMITS)
    assert passed_at(one, "w1") == 0.0
    assert passed_at(one, "w2") == 0.0
    between = replace(ROW[1], trigger_distance=4.0)
    assert passed_at(flight(add(ROW[0], between, ROW[2]), limits=LIMITS), "w2") > 1.5


def test_the_place_ahead_on_a_line_of_pictures_does_not_slow_the_drone_down() -> None:
    """Nor is the line's end passed, at which the last picture is due."""
    far = Waypoint("far", 120.0, 0.0, 2.0, trigger_distance=5.0)
    one = flight(add(Waypoint("near", 5.0, 0.0, 2.0), far, ROW[0]), limits=LIMITS)
    one.run(until=lambda: one.mission.status.visits == 1)
    one.run(20.0)
    sent = one.turn().sent
    assert isinstance(sent, PositionSetpoint)
    assert 10.0 < sent.position[0] < 119.0
    assert sent.passing_speed == 2.0
    for record in (one.turn() for _ in range(900)):
        if isinstance(record.sent, PositionSetpoint) and one.status.visits == 1:
            there = far.position - record.sent.position
            room = braking_distance(record.sent.passing_speed, 3.0, 0.3)
            assert room <= float(np.linalg.norm(there)) + 1e-6
    assert one.status.visits >= 2


def test_a_corner_on_the_way_to_a_picture_is_no_place_ahead() -> None:
    """A drone that was blown off its line, behind a zone, passes none of the zone's corners."""
    zone = [(40.0, 1.5), (50.0, 1.5), (50.0, 6.0), (40.0, 6.0)]
    limits = LIMITS.model_copy(update={"geofence": GeofenceConfig(no_fly=[zone], margin=0.5)})
    far = Waypoint("far", 120.0, 0.0, 2.0, trigger_distance=5.0)
    one = flight(add(Waypoint("near", 5.0, 0.0, 2.0), far), limits=limits)
    one.run(until=lambda: one.mission.status.visits == 1)
    one.run(8.0)
    one.vehicle.position[:2] = (38.0, 4.0)
    one.turn()
    sent = one.turn().sent
    assert isinstance(sent, PositionSetpoint)
    assert sent.position[0] < 119.0
    assert sent.passing_speed == 0.0
