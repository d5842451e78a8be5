"""What a camera sees of the ground decides how far lines and pictures of a survey lie apart."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from keywords import keywords

from aerodaas.errors import SchedulerError
from aerodaas.schedulers.trajectory.coverage import cover
from aerodaas.schedulers.trajectory.survey_camera import SurveyCamera

FIELD = [(0.0, 0.0), (90.0, 0.0), (90.0, 40.0), (0.0, 40.0)]
ZONE = [(30.0, 12.0), (45.0, 12.0), (45.0, 22.0), (30.0, 22.0)]


def test_a_data_sheet_gives_the_footprint() -> None:
    """A sensor of 13.2 by 8.8 mm behind 8.8 mm sees 150 by 100 m from 100 m."""
    camera = SurveyCamera(2.0 * math.atan2(13.2, 2.0 * 8.8), 1.5, 0.8, 0.6, pixels=5472)
    assert camera.footprint(100.0) == pytest.approx((150.0, 100.0))
    assert camera.trigger_distance(100.0) == pytest.approx(20.0)
    assert camera.line_spacing(100.0) == pytest.approx(60.0)
    assert camera.ground_resolution(100.0) == pytest.approx(0.0274, abs=1e-4)


@pytest.mark.parametrize(
    "settings",
    [
        (0.0, 1.5, 0.5, 0.5),
        (math.pi, 1.5, 0.5, 0.5),
        (1.0, 0.0, 0.5, 0.5),
        (1.0, 1.5, 1.0, 0.5),
        (1.0, 1.5, 0.5, -0.1),
        (math.nan, 1.5, 0.5, 0.5),
    ],
)
def test_a_camera_that_is_none_is_refused(settings: tuple[float, float, float, float]) -> None:
    """Degrees for radians, and shares of more than the whole."""
    with pytest.raises(SchedulerError):
        SurveyCamera(*settings)


@given(fov=st.floats(0.1, 3.0), resolution=st.floats(1e-4, 1.0), pixels=st.integers(16, 10_000))
def test_a_resolution_has_its_height(fov: float, resolution: float, pixels: int) -> None:
    """Which gives back the resolution."""
    camera = SurveyCamera(fov, pixels=pixels)
    height = camera.height(resolution)
    assert camera.ground_resolution(height) == pytest.approx(resolution)


def test_without_pixels_there_is_no_resolution() -> None:
    """Nor a height that gives one; and a camera's numbers are positive."""
    assert SurveyCamera(1.0).ground_resolution(10.0) is None
    with pytest.raises(SchedulerError, match="give the camera its pixels"):
        SurveyCamera(1.0).height(0.02)
    for resolution in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(SchedulerError, match="in metres a pixel"):
            SurveyCamera(1.0, pixels=640).height(resolution)
    with pytest.raises(SchedulerError, match="pixels must be positive"):
        SurveyCamera(1.0, pixels=0)
    with pytest.raises(SchedulerError, match="interval must be positive"):
        SurveyCamera(1.0, interval=math.nan)


def test_an_area_has_a_width_or_a_camera() -> None:
    """One of them says how wide the strips are."""
    camera = SurveyCamera(1.0)
    with pytest.raises(SchedulerError, match="a width or a camera"):
        cover(FIELD, height=20.0)
    with pytest.raises(SchedulerError, match="a width or a camera"):
        cover(FIELD, height=20.0, width=5.0, camera=camera)


@given(
    fov=st.floats(0.5, 1.6),
    front=st.floats(0.3, 0.9),
    side=st.floats(0.3, 0.8),
    angle=st.sampled_from([0.0, math.pi / 2]),
)
@settings(max_examples=20)
def test_every_place_is_on_as_many_pictures_as_the_overlap_says(
    fov: float, front: float, side: float, angle: float
) -> None:
    """Pictures lie no farther apart than asked along and across, and reach both ends of a line."""
    camera = SurveyCamera(fov, 1.5, front, side)
    plan = cover(FIELD, height=20.0, camera=camera, angle=angle)
    most = camera.trigger_distance(20.0)
    lines = []
    for before, there in pairwise(plan.waypoints):
        assert keywords(there).gimbal_pitch == -math.pi / 2
        if keywords(there).trigger_distance is None:
            continue
        long = math.dist((before.x, before.y), (there.x, there.y))
        assert keywords(there).trigger_distance <= most + 1e-9
        assert long / keywords(there).trigger_distance == pytest.approx(
            round(long / keywords(there).trigger_distance)
        )
        lines.append(shapely.LineString([(before.x, before.y), (there.x, there.y)]))
    assert len(lines) == plan.sweeps
    for one, other in pairwise(sorted(lines, key=lambda line: line.centroid.coords[0])):
        assert one.distance(other) <= camera.line_spacing(20.0) + 1e-6


def test_a_strip_around_a_zone_is_one_line() -> None:
    """Its legs have the same distance, so that pictures count on around the corners."""
    plan = cover(
        FIELD, height=20.0, camera=SurveyCamera(1.0, gimbal=False), no_fly=[ZONE], start=(0.0, 0.0)
    )
    distances = [keywords(one).trigger_distance for one in plan.waypoints]
    groups = " ".join("x" if one is None else f"{one:.6f}" for one in distances).split("x")
    kinds = [set(group.split()) for group in groups if group.split()]
    assert len(kinds) == plan.sweeps
    assert all(len(kind) == 1 for kind in kinds)
    assert max(len(group.split()) for group in groups) > 1
    assert {keywords(one).gimbal_pitch for one in plan.waypoints} == {None}


def test_a_width_alone_takes_no_pictures() -> None:
    """As ever."""
    plan = cover(FIELD, height=20.0, width=10.0)
    assert {keywords(one).trigger_distance for one in plan.waypoints} == {None}
