"""Looking at a place: by the gimbal, by the nose where it has no yaw, and never at nonsense."""

from __future__ import annotations

import math

import numpy as np
import pytest
from flights import add, flight
from hypothesis import given
from hypothesis import strategies as st
from surveyors import Gimbal, Surveyor, lost, patience, simulated

from aerodaas.clock import NANOSECONDS
from aerodaas.extensions.payload.equipment import GimbalTarget
from aerodaas.extensions.payload.point_of_interest import PointOfInterest, direction_to
from aerodaas.geometry.frames import rotation_from_rpy, wrap_angle
from aerodaas.messages.mission import MissionState
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import PositionSetpoint
from aerodaas.messages.waypoints import Waypoint

coordinate = st.floats(-500.0, 500.0)
place = st.tuples(coordinate, coordinate, coordinate)


@given(place, place)
def test_who_looks_in_that_direction_sees_the_place(
    spot: tuple[float, ...], here: tuple[float, ...]
) -> None:
    """The line of sight of these angles goes through it, unless it is straight below or above."""
    way = np.array(spot) - np.array(here)
    seen = direction_to(np.array(spot), np.array(here), 0.3)
    if np.linalg.norm(way) < 1.0:
        assert seen is None
        return
    assert seen is not None
    pitch, bearing = seen
    assert bearing is not None
    assert -math.pi / 2 <= pitch <= math.pi / 2
    sight = rotation_from_rpy(0.0, -pitch, bearing) @ np.array([1.0, 0.0, 0.0])
    if math.hypot(way[0], way[1]) >= 0.1 * abs(way[2]):
        assert sight == pytest.approx(way / np.linalg.norm(way), abs=1e-6)
    else:
        assert bearing == 0.3
        assert abs(pitch) > math.radians(84)


@given(st.lists(st.floats(), min_size=7, max_size=7), st.none() | st.floats(-3, 3))
def test_no_target_is_anything_but_finite(numbers: list[float], yaw: float | None) -> None:
    """Whatever an estimator says of place and heading, and wherever the spot is."""
    told: list[GimbalTarget] = []

    class Deaf:
        """A gimbal that takes note."""

        fault = ""
        attitude = None

        def aim(self, target: GimbalTarget) -> GimbalTarget:
            """Take note."""
            told.append(target)
            return target

    gaze = PointOfInterest()
    gaze.at(np.array(numbers[:3]))
    for gimbal in (Deaf(), None):
        seen = Odometry(np.array(numbers[3:6]), np.zeros(3), numbers[6])
        if math.isinf(numbers[6]):
            return
        gaze.aim(gimbal, seen, 0, yaw)
        assert gaze.heading is None or math.isfinite(gaze.heading)
    assert all(math.isfinite(one.pitch) and math.isfinite(one.yaw) for one in told)


def test_over_the_place_the_bearing_stays() -> None:
    """It would turn by half a circle at once; at the place itself nothing is told."""
    spot = np.array([0.0, 0.0, 0.0])
    _, before = direction_to(spot, np.array([-5.0, 0.0, 20.0]), None) or (0.0, None)
    assert before == pytest.approx(0.0)
    pitch, bearing = direction_to(spot, np.array([0.5, 0.0, 20.0]), before) or (0.0, None)
    assert pitch == pytest.approx(-math.pi / 2, abs=0.03)
    assert bearing == before
    assert direction_to(spot, np.array([0.2, 0.2, 0.5]), before) is None
    assert direction_to(spot, np.array([0.0, 0.0, 20.0]), None) == (-math.pi / 2, None)


AROUND = (
    Waypoint("south", 0, -8, 6, look_at=(0.0, 0.0, 0.0)),
    Waypoint("east", 8, 0, 6),
    Waypoint("north", 0, 8, 6, photo=True),
)


def test_a_gimbal_keeps_looking_at_the_place() -> None:
    """While the drone flies around it, until another waypoint ends it; the nose flies ahead."""
    vehicle = Surveyor()
    end = Waypoint("end", 8, 8, 6, gimbal_pitch=0.0)
    made = flight(add(*AROUND, end), vehicle=vehicle)
    made.run(until=lambda: "south" in made.status.visited)
    offsets = []
    while "north" not in made.status.visited:
        made.turn()
        gimbal = vehicle.gimbal
        assert gimbal is not None
        seen = direction_to(np.zeros(3), vehicle.position, None)
        assert seen is not None
        pitch, bearing = seen
        assert bearing is not None
        aside = wrap_angle(bearing - vehicle.yaw - gimbal.yaw)
        offsets.append(max(abs(gimbal.pitch - pitch), abs(aside)))
    # The test's gimbal turns at 1 rad/s, and the nose turns away under it at each corner.
    assert np.median(offsets) < 0.06
    assert vehicle.yaw == pytest.approx(3 * math.pi / 4, abs=0.5)
    (photo,) = made.mission.photos
    assert photo.gimbal is not None
    assert photo.gimbal.pitch == pytest.approx(math.atan2(-6, 8), abs=0.08)
    made.run()
    made.expect(MissionState.LANDED)
    assert vehicle.gimbal is not None
    assert vehicle.gimbal.aims[-1] == GimbalTarget(0.0, 0.0)
    assert not lost(made)


class Tilting(Gimbal):
    """A gimbal without a yaw axis."""

    def aim(self, target: GimbalTarget) -> GimbalTarget:
        """Keep its yaw."""
        return super().aim(GimbalTarget(target.pitch, 0.0))


@pytest.mark.parametrize("kind", ["without a yaw", "none"])
def test_the_nose_looks_there_where_the_gimbal_cannot(kind: str) -> None:
    """All the way; the waypoints are reached and the picture is taken all the same."""
    vehicle = Surveyor()
    vehicle.gimbal = Tilting(vehicle.clock) if kind == "without a yaw" else None
    assert vehicle.photo_camera is not None
    vehicle.photo_camera.gimbal = vehicle.gimbal
    made = flight(add(*AROUND), vehicle=vehicle)
    made.run(until=lambda: "south" in made.status.visited)
    offsets = []
    while "north" not in made.status.visited:
        made.turn()
        towards = math.atan2(-vehicle.position[1], -vehicle.position[0])
        offsets.append(abs(wrap_angle(towards - vehicle.yaw)))
    assert max(offsets[40:]) < 0.25
    assert made.status.photos == (1, 0)
    assert not lost(made)
    made.run()
    made.expect(MissionState.LANDED)


def test_a_waypoints_own_yaw_is_kept() -> None:
    """The gimbal looks at the place as far as it can."""
    vehicle = Surveyor()
    asked = Waypoint("south", 0, -8, 6, yaw=1.0, look_at=(0.0, 0.0, 0.0), photo=True)
    made = flight(add(asked), vehicle=vehicle)
    made.run(until=lambda: bool(made.status.photos[0]))
    assert vehicle.yaw == pytest.approx(1.0, abs=0.2)
    (photo,) = made.mission.photos
    assert photo.gimbal is not None
    assert wrap_angle(vehicle.yaw + photo.gimbal.yaw - math.pi / 2) == pytest.approx(0, abs=0.1)


def test_a_waypoints_own_yaw_is_kept_by_a_gimbal_that_cannot_turn() -> None:
    """It looks up and down as it should, which is all that can be waited for."""
    vehicle = Surveyor()
    vehicle.gimbal = Tilting(vehicle.clock)
    assert vehicle.photo_camera is not None
    vehicle.photo_camera.gimbal = vehicle.gimbal
    asked = Waypoint("south", 0, -8, 6, yaw=0.2, look_at=(0.0, 0.0, 0.0), photo=True)
    made = flight(add(asked), vehicle=vehicle)
    made.run()
    made.expect(MissionState.LANDED)
    assert made.status.photos == (1, 0)


def test_a_picture_waits_until_the_gimbal_looks_there() -> None:
    """One that does not come costs the picture, and is told."""
    vehicle = Surveyor()
    assert vehicle.gimbal is not None
    vehicle.gimbal.stuck = True
    asked = Waypoint("south", 0, -8, 6, look_at=(0.0, 0.0, 0.0), photo=True)
    made = flight(add(asked), vehicle=vehicle, options=patience(2.0))
    made.run()
    made.expect(MissionState.LANDED)
    assert made.status.photos == (0, 1)
    assert any("the gimbal was not there" in text for text in lost(made))


def test_a_gimbal_that_raises_ends_no_flight() -> None:
    """It is told, and the waypoints are visited."""

    class Broken(Gimbal):
        """Raises whatever it is told."""

        def aim(self, target: GimbalTarget) -> GimbalTarget:
            """Fail."""
            raise RuntimeError(str(target))

    vehicle = Surveyor()
    vehicle.gimbal = Broken(vehicle.clock)
    made = flight(add(*AROUND[:2]), vehicle=vehicle)
    made.run()
    made.expect(MissionState.LANDED)
    assert list(made.status.visited) == ["south", "east"]
    assert any(text.startswith("the gimbal: ") for text in lost(made))


def test_a_gimbal_is_told_ten_times_a_second_at_most() -> None:
    """And once a second where nothing changes."""
    vehicle = Surveyor()
    made = flight(add(Waypoint("stay", 0, -8, 6, 10.0, look_at=(0.0, 0.0, 0.0))), vehicle=vehicle)
    made.run_to(MissionState.LOITERING)
    made.run(3.0)
    assert vehicle.gimbal is not None
    before = len(vehicle.gimbal.aims)
    made.run(4.0)
    assert 3 <= len(vehicle.gimbal.aims) - before <= 6


def test_the_way_back_is_flown_nose_ahead() -> None:
    """A place that is looked at ends with the last waypoint."""
    vehicle = Surveyor()
    vehicle.gimbal = None
    made = flight(add(AROUND[0]), vehicle=vehicle)
    made.run_to(MissionState.RETURNING)
    made.run(1.0)
    sent = vehicle.sent[-1]
    assert isinstance(sent, PositionSetpoint)
    home = math.atan2(-vehicle.position[1], -vehicle.position[0])
    assert sent.yaw == pytest.approx(home, abs=0.1)


def test_a_simulated_drone_photographs_what_it_flies_around() -> None:
    """The place lies within a few degrees of the middle of every picture, by the truth."""
    spot = np.array([10.0, 10.0, 2.0])
    corners = [(0, 0), (20, 0), (20, 20), (0, 20)]
    mission = simulated(
        Waypoint("w", 0, 0, 12, look_at=(10.0, 10.0, 2.0), photo=True),
        *[Waypoint(f"w{n}", x, y, 12, trigger_interval=2.0) for n, (x, y) in enumerate(corners)],
        noise=0.0,
        wind=0.0,
    )
    photos = mission.photos
    assert len(photos) > 8
    off = []
    for photo in photos:
        assert photo.truth is not None
        assert photo.gimbal is not None
        yaw = photo.truth.yaw + photo.gimbal.yaw
        sight = rotation_from_rpy(0.0, -photo.gimbal.pitch, yaw) @ np.array([1.0, 0.0, 0.0])
        way = spot - photo.truth.position
        off.append(math.degrees(math.acos(min(1.0, float(sight @ way) / np.linalg.norm(way)))))
    assert np.median(off) < 3.0
    assert off[0] < 3.5
    assert photos[0].stamp > NANOSECONDS
