"""Surveys by a camera: planned by what it sees, and photographed where they were planned."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pytest
from keywords import keywords
from surveyors import simulated, surveying

from aerodaas.errors import ConfigError, SchedulerError
from aerodaas.extensions.surveys.planning import (
    SurveyPhotos,
    SurveySettings,
    planned_photos,
    planned_survey,
    survey_camera,
)
from aerodaas.messages.waypoints import Waypoint
from aerodaas.schedulers.trajectory.survey_camera import SurveyCamera

FIELD = [(0.0, 0.0), (50.0, 0.0), (60.0, 30.0), (0.0, 30.0)]
DOWN = {"pitch": 90, "horizontal_fov": 60, "width": 4000, "height": 3000}


def photos_of(settings: SurveySettings) -> SurveyPhotos:
    """Pictures of a survey of the field."""
    photos = planned_survey(surveying(), FIELD, settings).photos
    assert photos is not None
    return photos


@pytest.mark.parametrize(("wind", "speed"), [(0.0, 2.0), (4.0, 4.0)])
def test_pictures_are_taken_where_they_were_planned(wind: float, speed: float) -> None:
    """Within half a metre, and overlap as asked, along and across, by the simulator's truth."""
    camera = survey_camera(surveying(), front_overlap=0.7, side_overlap=0.6)
    survey = planned_survey(surveying(), FIELD, SurveySettings(8.0, speed=speed, camera=camera))
    assert survey.photos is not None
    assert survey.photos.warning == ""
    flown = simulated(*survey.waypoints, noise=0.0, wind=wind)
    photos = flown.photos
    assert flown.status.photos[1] == 0
    assert len(photos) == len(survey.photos.places)
    across, along = camera.footprint(8.0)
    lines: dict[str, list[np.ndarray]] = {}
    for photo, planned in zip(photos, survey.photos.places, strict=True):
        assert photo.truth is not None
        assert photo.gimbal is not None
        place = photo.truth.position
        assert math.dist(place[:2], planned) < 0.5
        assert abs(place[2] - 8.0) < 0.5
        assert photo.gimbal.pitch == pytest.approx(-math.pi / 2, abs=0.05)
        # The wide side of the picture lies across the line.
        askew = math.remainder(photo.truth.yaw - survey.angle, math.pi)
        assert abs(askew) < 0.12
        lines.setdefault(photo.label, []).append(place[:2])
    assert len(lines) == survey.sweeps > 3
    for line in lines.values():
        for one, other in pairwise(line):
            assert 0.68 < 1.0 - math.dist(one, other) / along < 0.75
    normal = np.array([-math.sin(survey.angle), math.cos(survey.angle)])
    middles = sorted(float(np.mean(line, axis=0) @ normal) for line in lines.values())
    for low, high in pairwise(middles):
        assert 0.58 < 1.0 - (high - low) / across < 0.65


def test_a_lens_that_zooms_is_set_to_what_was_planned_with() -> None:
    """Whatever it was left at; without a zoom nothing is set."""
    for settings, zoom in (({**DOWN, "zoom": 4}, 0.0), (DOWN, None)):
        camera = survey_camera(surveying("simulated", settings))
        survey = planned_survey(surveying(), FIELD, SurveySettings(10.0, camera=camera))
        assert {keywords(one).zoom for one in survey.waypoints} == {zoom}


def test_a_robot_has_its_camera() -> None:
    """View, aspect and pixels of the file; its own gimbal or its mount."""
    hung = survey_camera(surveying())
    assert math.degrees(hung.horizontal_fov) == pytest.approx(82.6)
    assert hung.aspect == pytest.approx(16 / 9)
    assert (hung.pixels, hung.gimbal, hung.interval) == (640, True, 0.5)
    bolted = survey_camera(surveying("mavlink", {**DOWN, "photo_interval": 2}), "cam0")
    assert (bolted.pixels, bolted.gimbal, bolted.interval) == (4000, False, 2.0)
    assert survey_camera(surveying("mavlink", DOWN), "drone/cam0").interval is None
    # Turned by a quarter, its wide side lies along the flight.
    turned = survey_camera(surveying("mavlink", {**DOWN, "yaw": -90}))
    assert turned.footprint(10.0) == pytest.approx(bolted.footprint(10.0)[::-1])
    assert turned.pixels == 3000
    assert turned.ground_resolution(10.0) == pytest.approx(bolted.ground_resolution(10.0))


@pytest.mark.parametrize(
    ("driver", "cameras", "name", "said"),
    [
        ("simulated", [{}], None, 'looks 0 degrees down .* "gimbal": {}'),
        ("tello", [{}], None, "drone/cam0 looks 0 degrees down and not straight down"),
        ("simulated", [{"pitch": 80}], None, "looks 80 degrees down"),
        ("simulated", [{"gimbal": {"lowest": -60}}], None, "turns down to -60 degrees"),
        ("simulated", [{**DOWN, "yaw": 30}], None, "30 degrees to the left.*turn it to 0, 90"),
        ("mavlink", [{"gimbal": {}}], None, "view of drone/cam0 is not known.*horizontal_fov"),
        ("simulated", [DOWN], "lens", "has no camera 'lens'; it has cam0"),
        ("simulated", [{}, DOWN], "cam1", "with its first camera, which is cam0"),
    ],
)
def test_cameras_that_cannot_survey_are_refused(
    driver: str, cameras: list[Mapping[str, object]], name: str | None, said: str
) -> None:
    """With the remedy."""
    with pytest.raises(SchedulerError, match=said):
        survey_camera(surveying(driver, *cameras), name)


def test_a_robot_without_a_camera_surveys_by_width_alone() -> None:
    """And bad settings are told as ever."""
    blind = surveying().model_copy(update={"sensors": []})
    with pytest.raises(SchedulerError, match=r"no camera to survey with.*a width"):
        survey_camera(blind)
    with pytest.raises(ConfigError, match="sensor drone/cam0: settings: width"):
        survey_camera(surveying("simulated", {**DOWN, "width": 1}))
    for settings in (SurveySettings(9.0), SurveySettings(9.0, 4.0, camera=SurveyCamera(1.0))):
        with pytest.raises(SchedulerError, match="a width or a camera"):
            planned_survey(surveying(), FIELD, settings)
    assert planned_survey(surveying(), FIELD, SurveySettings(9.0, 8.0)).photos is None


def test_figures_of_pictures() -> None:
    """Resolution, spacing and time between two, and how many come too soon for the camera."""
    camera = survey_camera(surveying("mavlink", {**DOWN, "photo_interval": 1}), side_overlap=0.6)
    photos = photos_of(SurveySettings(10.0, speed=1.2, camera=camera))
    across, along = camera.footprint(10.0)
    assert photos.resolution == pytest.approx(across / 4000)
    assert photos.line_spacing == pytest.approx(0.4 * across)
    assert photos.spacing == pytest.approx(0.25 * along, rel=0.1)
    assert photos.interval == pytest.approx(photos.spacing / 1.2)
    assert (photos.too_fast, photos.warning) == (0, "")
    hasty = photos_of(SurveySettings(10.0, speed=4.0, camera=camera))
    assert 100 < hasty.too_fast < len(hasty.places)
    assert "needs 1 s for one: fly at 1." in hasty.warning
    unknown = survey_camera(surveying("mavlink", DOWN))
    assert photos_of(SurveySettings(10.0, speed=8.0, camera=unknown)).warning == ""


def test_pictures_count_on_around_a_corner_and_nowhere_else() -> None:
    """As they do in flight; a way between two lines has none, and there is an end to them."""
    camera = SurveyCamera(1.0)
    bent = [
        Waypoint("a", 0, 0, 9),
        Waypoint("b", 10, 0, 9, trigger_distance=4.0),
        Waypoint("c", 10, 10, 9, trigger_distance=4.0),
        Waypoint("d", 20, 10, 9),
    ]
    photos = planned_photos(bent, camera, height=9.0, speed=2.0)
    assert list(photos.places) == [(0, 0), (4, 0), (8, 0), (10, 2), (10, 6), (10, 10)]
    assert not planned_photos(bent[:1], camera, height=9.0, speed=2.0).places
    long = Waypoint("b", 6000.0, 0, 9, trigger_distance=0.5)
    with pytest.raises(SchedulerError, match="more than 10000 pictures: draw a smaller area"):
        planned_photos([bent[0], long], camera, height=9.0, speed=2.0)
