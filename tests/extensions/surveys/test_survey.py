"""Surveys as they would be flown: inside the fence, with figures that a flight bears out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import shapely
from flights import add, flight, length

from aerodaas.config.model import GeofenceConfig, LimitsConfig, RobotConfig
from aerodaas.errors import SchedulerError
from aerodaas.extensions.surveys.planning import MOST_CORNERS, SurveySettings, planned_survey
from aerodaas.geometry.energy import EnergyModel
from aerodaas.messages.mission import MissionState as S

FENCE = GeofenceConfig(polygon=[(-20, -20), (40, -20), (40, 40), (-20, 40)], ceiling=20)
ZONE = [(8.0, 8.0), (12.0, 8.0), (12.0, 12.0), (8.0, 12.0)]
FIELD = [(0.0, 0.0), (20.0, 0.0), (20.0, 12.0), (0.0, 12.0)]
LIMITS = LimitsConfig(cruise_speed=2.0, geofence=FENCE, max_range=45)
HOW = SurveySettings(height=4.0, width=5.0)


def robot(**limits: object) -> RobotConfig:
    """A drone with these limits."""
    return RobotConfig(id="drone", limits=LIMITS.model_copy(update=limits))


def test_a_flight_takes_as_long_and_as_much_as_was_said() -> None:
    """Length and time of the preview are those of the simulated flight, and so is the charge."""
    survey = planned_survey(robot(), FIELD, HOW, start=np.array([0.0, 0.0, 1.5]))
    flown = flight(add(*survey.waypoints), limits=LIMITS)
    flown.run_to(S.ENROUTE)
    began, until = flown.seconds, len(flown.track)
    flown.run(until=lambda: survey.waypoints[-1].id in flown.status.visited)
    assert flown.seconds - began == pytest.approx(survey.seconds, rel=0.05)
    way_there = float(np.linalg.norm(survey.waypoints[0].position - [0, 0, 1.5]))
    way = length(flown.track[until:])
    assert way == pytest.approx(survey.length + way_there, rel=0.06)
    model = EnergyModel(LIMITS.endurance)
    places = [one.position for one in survey.waypoints]
    home = model.way_home(places[-1], np.zeros(3), 2.0)
    assert survey.battery == pytest.approx(home + survey.seconds / 900, rel=0.25)


@pytest.mark.parametrize(
    ("area", "said"),
    [
        ([(0, 0), (50, 0), (50, 12)], r"\(50.0, 0.0\) is 50 m away, beyond the range"),
        ([(0, 0), (41, 0), (20, 12)], r"leaves the fence: \(41.0, 0.0\) lies 1.0 m outside"),
        ([(0, 0), (39.8, 0), (20, 12)], "leaves the fence: .*within 0.5 m"),
        ([(0, 0), (20, 0), (0, 10), (20, 10)], "crosses itself"),
        ([(0, 0), (10, 10), (20, 20)], "encloses nothing"),
        ([(0, 0), (20, 0)], f"3 to {MOST_CORNERS} corners, not 2"),
        ([(float(n), float(n % 2)) for n in range(MOST_CORNERS + 1)], "corners, not 31"),
        ([(5, 5), (15, 5), (15, 15), (5, 15)], r"enters a no-fly zone at \(.*draw it beside"),
        ([(0, 7.7), (20, 7.7), (20, 0), (0, 0)], "enters a no-fly zone"),
    ],
)
def test_areas_that_must_not_be_flown_over_are_refused(
    area: list[tuple[float, float]], said: str
) -> None:
    """With the place, and before anything is planned; margins count, too."""
    fence = FENCE.model_copy(update={"no_fly": [ZONE]})
    with pytest.raises(SchedulerError, match=said):
        planned_survey(robot(geofence=fence), area, HOW)


def test_an_area_that_cuts_a_corner_of_the_fence_is_refused() -> None:
    """All its corners lie inside, and an edge between two of them does not."""
    bent = [(-20.0, -20.0), (40.0, -20.0), (40.0, 0.0), (0.0, 0.0), (0.0, 40.0), (-20.0, 40.0)]
    fence = GeofenceConfig(polygon=bent, ceiling=20)
    with pytest.raises(SchedulerError, match="between two of its corners"):
        planned_survey(robot(geofence=fence), [(-10, 30), (30, -10), (-10, -10)], HOW)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"height": 25.0}, "above the ceiling of 20 m"),
        ({"height": 0.1}, "under the floor"),
        ({"width": 0.05}, "more than 200 strips"),
        ({"overlap": 0.99}, "more than 200 strips"),
        ({"width": -1.0}, "strips|positive"),
    ],
)
def test_settings_without_a_survey_are_refused(changes: dict[str, Any], said: str) -> None:
    """Before they cost time."""
    how = SurveySettings(**{"height": 4.0, "width": 5.0, **changes})
    with pytest.raises(SchedulerError, match=said):
        planned_survey(robot(), FIELD, how)


def test_a_survey_may_be_too_long() -> None:
    """A mission takes a thousand waypoints at once; this many nobody wanted."""
    teeth = [(3.0 * x + dx, y) for x in range(7) for dx, y in ((0, 0.0), (1, 18.0), (2, 0.0))]
    comb = [*teeth, (20.0, -1.0), (0.0, -1.0)]
    with pytest.raises(SchedulerError, match="at most 500 are flown"):
        planned_survey(robot(), comb, SurveySettings(4.0, 0.4, 0.0, 0.0))


def test_no_fly_zones_are_flown_around_where_that_is_asked_for() -> None:
    """The path keeps the fence's margin, and the drone's own fence takes all of it."""
    fence = FENCE.model_copy(update={"no_fly": [ZONE]})
    how = SurveySettings(height=4.0, width=5.0, around=True)
    survey = planned_survey(robot(geofence=fence), [(0, 0), (20, 0), (20, 20), (0, 20)], how)
    path = shapely.LineString([(one.x, one.y) for one in survey.waypoints])
    assert path.distance(shapely.Polygon(ZONE)) >= 0.5
    held = flight(add(*survey.waypoints), limits=robot(geofence=fence).limits)
    assert not held.status.given_up


def test_direction_and_speed_are_the_operators() -> None:
    """The sweeps' direction as asked; a speed above the robot's highest one is that."""
    how = SurveySettings(4.0, 5.0, angle=math.pi / 2, speed=50.0)
    survey = planned_survey(robot(max_speed=3.0), FIELD, how)
    first, second = survey.waypoints[:2]
    assert abs(first.x - second.x) < 1e-6 < abs(first.y - second.y)
    assert survey.angle == math.pi / 2
    assert {one.speed for one in survey.waypoints} == {3.0}
