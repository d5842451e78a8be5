"""Crowds and distances by the camera's geometry, against people placed on the ground."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from follow_world import TELLO, Snapshot
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodaas.analytics.monitoring.distance import DistanceAnalytics
from aerodaas.analytics.people.crowd_density import CrowdDensityAnalytics
from aerodaas.clock import NANOSECONDS
from aerodaas.errors import ConfigError
from aerodaas.following.ground_point import GroundView
from aerodaas.geometry.frames import CameraModel, Vector, rotation_from_rpy
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.readings import Alert

DOWN = replace(TELLO, pitch=math.radians(40))


def odometry(height: float, roll: float = 0.0, pitch: float = 0.0) -> Odometry:
    """A drone above home, looking east."""
    return Odometry(np.array([0.0, 0.0, height]), np.zeros(3), 0.0, roll, pitch)


def seen(
    people: list[tuple[float, float]], camera: CameraModel, pose: Odometry, step: int = 0
) -> Detections:
    """Boxes of upright people of 1.7 m at these places (metres east, north)."""
    turn = rotation_from_rpy(pose.roll, pose.pitch, pose.yaw)

    def pixel(point: Vector) -> tuple[float, float, float]:
        return camera.project(turn.T @ (point - pose.position))

    items = []
    for x, y in people:
        u, feet, depth = pixel(np.array([x, y, 0.0]))
        _, head, _ = pixel(np.array([x, y, 1.7]))
        half = 0.25 * camera.fx / depth
        box = np.clip([u - half, head, u + half, feet], 0, [1280, 720, 1280, 720])
        left, top, right, bottom = box.tolist()
        if depth > 0 and right > left and bottom > top:
            items.append(Detection((left, top, right, bottom), "person", 0.9))
    header = Header(step, step * NANOSECONDS // 5, "drone/cam")
    return Detections(header, tuple(items), 1280, 720, camera, pose)


@given(
    x=st.floats(2.0, 12.0),
    y=st.floats(-2.0, 2.0),
    height=st.floats(3.0, 20.0),
    pitch=st.floats(0.2, 1.2),
    roll=st.floats(-0.2, 0.2),
    nose=st.floats(-0.15, 0.15),
)
@settings(max_examples=100)
def test_ground_points_undo_projection(
    x: float, y: float, height: float, pitch: float, roll: float, nose: float
) -> None:
    """What the camera projects from the ground is found there again, at any attitude."""
    camera = replace(TELLO, pitch=pitch)
    pose = odometry(height, roll, nose)
    turn = rotation_from_rpy(roll, nose, 0.0)
    u, v, depth = camera.project(turn.T @ (np.array([x, y, 0.0]) - pose.position))
    if depth <= 0.1:
        return
    view = GroundView(Detections(Header(0, 0, "c"), (), 1280, 720, camera, pose))
    (found,) = view.points(np.array([[u, v]]))
    assert found == pytest.approx([x, y], abs=1e-6 * max(1.0, x))


@pytest.mark.parametrize("pitch", [0.0, 0.3, 0.8, math.pi / 2])
def test_the_area_is_what_is_in_the_picture(pitch: float) -> None:
    """Against the share of random ground points that project into the picture."""
    camera, pose = replace(TELLO, pitch=pitch), odometry(6.0)
    view = GroundView(Detections(Header(0, 0, "c"), (), 1280, 720, camera, pose))
    random = np.random.default_rng(1)
    places = random.uniform(-20, 20, (20_000, 2)) + np.array([0.1, 0.0])
    inside = 0
    for x, y in places:
        if math.hypot(x - 0.1, y) > 20:
            continue
        u, v, depth = camera.project(np.array([x, y, 0.0]) - pose.position)
        inside += depth > 0 and 0 <= u <= 1280 and 0 <= v <= 720
    assert view.area(20.0) == pytest.approx(inside / len(places) * 1600, rel=0.06)


def test_density_is_people_for_each_square_metre() -> None:
    """A grid of one person for each m² has that peak, and alerts once above the limit."""
    people = [(6.4 + x, y + 0.4) for x in range(5) for y in range(-2, 3)]
    crowd = CrowdDensityAnalytics(limit=0.9, farthest=30)
    alerts: list[Alert] = []
    result = None
    for step in range(8):
        item = seen(people, DOWN, odometry(6.0), step)
        result = crowd.process(item, Snapshot(item.header.stamp, None, alerts))
    assert result is not None
    assert result.values["count"] == 25
    assert result.values["peak"] == pytest.approx(1.0)
    assert result.values["density"] == pytest.approx(25 / result.values["area"])
    assert [alert.kind for alert in alerts] == ["crowd_dense"]


def test_nobody_and_thousands_are_counted() -> None:
    """Zero people are no crowd; five thousand boxes take well under a second."""
    crowd = CrowdDensityAnalytics()
    empty = crowd.examine(seen([], DOWN, odometry(6.0)), Snapshot(0, None, []))
    assert empty.values["count"] == empty.values["density"] == empty.values["peak"] == 0
    one = seen([(6.0, 0.0)], DOWN, odometry(6.0))
    many = replace(one, items=one.items * 5000)
    assert crowd.examine(many, Snapshot(0, None, [])).values["count"] == 5000
    nonsense = replace(one, items=(replace(one.items[0], box=(math.nan, 0.0, 1.0, math.inf)),))
    assert crowd.examine(nonsense, Snapshot(0, None, [])).values["count"] == 0


def test_without_geometry_people_are_counted_and_the_lack_is_told_once() -> None:
    """The alert says what to do."""
    crowd = CrowdDensityAnalytics()
    alerts: list[Alert] = []
    for _ in range(3):
        item = replace(seen([(6.0, 0.0)], DOWN, odometry(6.0)), camera=None)
        result = crowd.examine(item, Snapshot(0, None, alerts))
        assert result.values == {"count": 1.0}
    assert len(alerts) == 1
    assert "horizontal_fov" in alerts[0].text


def test_the_nearest_is_told_and_alerted_once() -> None:
    """Of two people the nearer, with its bearing to the left."""
    near = DistanceAnalytics(limit=5.0)
    alerts: list[Alert] = []
    result = None
    for step in range(6):
        item = seen([(9.0, -1.0), (4.5, 1.0)], TELLO, odometry(1.5), step)
        result = near.process(item, Snapshot(item.header.stamp, None, alerts))
    assert result is not None
    assert result.values["distance"] == pytest.approx(math.hypot(4.5, 1.0), rel=0.03)
    assert result.values["bearing"] == pytest.approx(math.atan2(1.0, 4.5), abs=0.02)
    assert [alert.kind for alert in alerts] == ["too_near"]
    nothing = near.process(seen([], TELLO, odometry(1.5), 7), Snapshot(0, None, alerts))
    assert nothing is not None
    assert nothing.values == {}


@pytest.mark.parametrize("words", [{"limit": 0.0}, {"limit": math.nan}, {"sizes": {}}])
def test_distances_that_cannot_be_are_refused(words: dict[str, object]) -> None:
    """At build time."""
    with pytest.raises(ConfigError):
        DistanceAnalytics(**words)  # type: ignore[arg-type]
    with pytest.raises(ConfigError):
        CrowdDensityAnalytics(farthest=-1.0)
