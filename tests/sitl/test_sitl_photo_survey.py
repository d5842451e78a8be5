"""Pictures on the way by a real autopilot in simulation, which does not stop for them.

It needs a gimbal and a camera: for ArduCopter the parameters of `gimbal.parm`. Where the autopilot
tells of none, the tests are skipped.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.geometry.frames import GeodeticOrigin, rotation_from_rpy
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import AddNavigation
from sitl.autopilot import Autopilot
from sitl.flights import SitlFlight

pytestmark = [pytest.mark.sitl, pytest.mark.slow, pytest.mark.timeout(420), pytest.mark.wall_clock]

SPACING, LONG = 5.0, 40.0


@pytest.mark.parametrize("speed", [2.0, 5.0])
def test_pictures_lie_where_they_were_asked_for(autopilot: Autopilot, speed: float) -> None:
    """By the place that the autopilot itself had at each exposure."""
    lines = [
        Waypoint("a", 0, 0, 10, speed=speed, gimbal_pitch=-math.pi / 2),
        Waypoint("b", 0, LONG, 10, speed=speed, trigger_distance=SPACING),
        Waypoint("c", 10, LONG, 10, speed=speed),
        Waypoint("d", 10, 0, 10, speed=speed, trigger_distance=SPACING),
    ]
    survey = AddNavigation(AeroNavigation(data=lines))
    with SitlFlight(autopilot.url, survey, cruise_speed=5.0, max_speed=8.0) as flight:
        flight.run(60.0, lambda: flight.mission.state is S.ENROUTE)
        if not flight.vehicle.health().cameras:
            pytest.skip("this autopilot carries no camera")
        fix, here = flight.vehicle.read().gps, flight.vehicle.read().odometry.position
        assert fix is not None
        flight.run(240.0)
        assert flight.mission.state is S.LANDED, flight.story
        photos = flight.mission.photos
        alerts = [alert.text for alert in flight.mission.alerts]
        count = round(LONG / SPACING) + 1
        asked = [("b", 0.0, SPACING * n) for n in range(count)]
        asked += [("d", 10.0, LONG - SPACING * n) for n in range(count)]
        assert [photo.label for photo in photos] == [label for label, _, _ in asked], alerts
        origin = GeodeticOrigin(fix.latitude, fix.longitude)
        apart = []
        for photo, (_, east, north) in zip(photos, asked, strict=True):
            assert photo.place is not None
            x, y, _ = origin.to_local(photo.place.latitude, photo.place.longitude, 0.0)
            apart.append(math.hypot(x + here[0] - east, y + here[1] - north))
        flight.tell_outcome(
            f"{len(photos)} pictures at {speed:g} m/s, at most {max(apart):.2f} m from where they "
            f"were asked for, {sum(apart) / len(apart):.2f} m on average"
        )
        assert max(apart) < 0.5


def test_the_gimbal_keeps_looking_at_a_place(autopilot: Autopilot) -> None:
    """On a square around it, by the gimbal's own word at each exposure."""
    spot = np.array([10.0, 10.0, 0.0])
    corners = [(0, 0), (20, 0), (20, 20), (0, 20), (0, 0)]
    stops = [
        Waypoint(f"w{n}", x, y, 8, speed=3.0, trigger_interval=2.0, look_at=(10.0, 10.0, 0.0))
        for n, (x, y) in enumerate(corners)
    ]
    with SitlFlight(autopilot.url, AddNavigation(AeroNavigation(data=stops))) as flight:
        flight.run(60.0, lambda: flight.mission.state is S.ENROUTE)
        if flight.vehicle.read().gimbal is None or not flight.vehicle.health().cameras:
            pytest.skip("this autopilot carries no gimbal and camera")
        flight.run(240.0)
        assert flight.mission.state is S.LANDED, flight.story
        photos = flight.mission.photos
        off = []
        for photo in photos:
            assert photo.gimbal is not None
            assert photo.odometry is not None
            yaw = photo.odometry.yaw + photo.gimbal.yaw
            sight = rotation_from_rpy(0.0, -photo.gimbal.pitch, yaw) @ np.array([1.0, 0.0, 0.0])
            way = spot - photo.odometry.position
            off.append(math.degrees(math.acos(min(1.0, sight @ way / float(np.linalg.norm(way))))))
        flight.tell_outcome(
            f"{len(off)} pictures of a place, half of them within {np.median(off):.1f} degrees of "
            "their middle, "
            f"{max(off):.1f} at most"
        )
        assert len(off) > 10
        assert np.median(off) < 5.0
