"""Pictures with a gimbal of a real autopilot in simulation.

It needs one with a gimbal and a camera: for ArduCopter the parameters of `gimbal.parm` (a servo
gimbal and a servo camera). Where the autopilot tells of none, the test is skipped.
"""

from __future__ import annotations

import math

import pytest

from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import AddNavigation
from sitl.autopilot import Autopilot
from sitl.flights import SitlFlight

pytestmark = [pytest.mark.sitl, pytest.mark.slow, pytest.mark.timeout(420), pytest.mark.wall_clock]

STOPS = AddNavigation(
    AeroNavigation(
        data=[
            Waypoint("nadir", 0, 5, 3, gimbal_pitch=-math.pi / 2, photo=True),
            Waypoint("aside", 5, 5, 3, gimbal_pitch=-0.5, gimbal_yaw=0.7, photo=True),
            Waypoint("ahead", 5, 0, 3, gimbal_pitch=0.0, photo=True),
        ]
    )
)


def test_pictures_at_waypoints(autopilot: Autopilot) -> None:
    """Each with the gimbal where it was asked to look, and with the autopilot's place."""
    with SitlFlight(autopilot.url, STOPS) as flight:
        flight.run(60.0, lambda: flight.mission.state is S.ENROUTE)
        if flight.vehicle.read().gimbal is None or not flight.vehicle.health().cameras:
            pytest.skip("this autopilot carries no gimbal and camera")
        flight.run(180.0)
        assert flight.mission.state is S.LANDED, flight.story
        photos = flight.mission.photos
        alerts = [alert.text for alert in flight.mission.alerts]
        assert [photo.label for photo in photos] == ["nadir", "aside", "ahead"], alerts
        asked = [(-math.pi / 2, 0.0), (-0.5, 0.7), (0.0, 0.0)]
        for photo, (pitch, yaw) in zip(photos, asked, strict=True):
            assert photo.gimbal is not None
            assert photo.place is not None
            assert photo.gimbal.pitch == pytest.approx(pitch, abs=0.06)
            assert photo.gimbal.yaw == pytest.approx(yaw, abs=0.06)
        flight.tell_outcome("three pictures")
