"""Survey of an area: its path, length, time and battery, or why it cannot be flown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from aerodaas.config.model import LimitsConfig, RobotConfig
from aerodaas.errors import SchedulerError
from aerodaas.geometry.energy import EnergyModel
from aerodaas.geometry.frames import Vector
from aerodaas.geometry.free_path import Place
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.safety.geofence import Geofence
from aerodaas.mission.survey_photos import SurveyPhotos, planned_photos
from aerodaas.schedulers.trajectory.coverage import cover
from aerodaas.schedulers.trajectory.survey_camera import SurveyCamera

__all__ = ["MOST_CORNERS", "MOST_WAYPOINTS", "Survey", "SurveySettings", "plan_survey"]

MOST_CORNERS = 30
"""Most corners of an area: more take seconds to plan."""
MOST_WAYPOINTS = 500
_MOST_STRIPS = 200
_TOLERANCE = 1e-3
"""Metres by which a path may be nearer to the fence than its margin, for rounding."""


@dataclass(frozen=True)
class SurveySettings:
    """How an area is surveyed."""

    height: float
    """Metres above home."""
    width: float | None = None
    """Metres of ground that is seen across the sweep; see `coverage.footprint`. None: `camera`."""
    overlap: float = 0.2
    """Share of it, 0 to less than 1, that neighbouring strips have in common."""
    angle: float | None = None
    """Direction of the sweeps, radians counter-clockwise from east; None for the shortest path."""
    speed: float | None = None
    """m/s; None for the robot's cruise speed."""
    around: bool = False
    """Fly around no-fly zones within the area, which stay unseen; otherwise they are refused."""
    camera: SurveyCamera | None = None
    """Who takes pictures on the strips, in the place of `width` and `overlap`, which it knows; see
    `survey_photos.survey_camera`."""

    @classmethod
    def by_camera(
        cls,
        camera: SurveyCamera,
        *,
        height: float | None = None,
        ground_resolution: float | None = None,
        angle: float | None = None,
        speed: float | None = None,
        around: bool = False,
    ) -> SurveySettings:
        """Survey with `camera` from `height`, or from where a pixel is `ground_resolution` metres.

        Raises SchedulerError unless one of the two is given, and for a resolution that is none.
        """
        if (height is None) == (ground_resolution is None):
            raise SchedulerError("a survey needs a height or a ground resolution: give it one")
        if ground_resolution is not None:
            height = camera.height(ground_resolution)
        assert height is not None  # noqa: S101 - given, or by the resolution
        return cls(height, angle=angle, speed=speed, around=around, camera=camera)

    @property
    def strips(self) -> tuple[float, float]:
        """Metres of ground seen across the sweep, and the share that neighbours have in common.

        Raises SchedulerError unless there is either a width or a camera.
        """
        if (self.width is None) == (self.camera is None):
            raise SchedulerError("a survey needs a width or a camera: give it one of them")
        if self.camera is not None:
            return self.camera.footprint(self.height)[0], self.camera.side_overlap
        assert self.width is not None  # noqa: S101 - or there is a camera
        return self.width, self.overlap


@dataclass(frozen=True)
class Survey:
    """A survey as it would be flown."""

    waypoints: tuple[Waypoint, ...]
    """Local ENU, in order."""
    angle: float
    """Direction of the sweeps, radians counter-clockwise from east."""
    sweeps: int
    length: float
    """Metres from the first waypoint to the last."""
    seconds: float
    """From the start to the last waypoint, the way to the first one included."""
    battery: float
    """Charge, 0 to 1, from the start through the survey home, by the energy model."""
    photos: SurveyPhotos | None = None
    """Of a survey with a camera."""


def plan_survey(
    robot: RobotConfig,
    outline: Sequence[Place],
    settings: SurveySettings,
    *,
    start: Vector | None = None,
    wind: Vector | None = None,
) -> Survey:
    """Plan the survey of the area inside `outline`, metres east and north.

    Args:
        robot: Who flies it; its limits count.
        outline: 3 to `MOST_CORNERS` corners.
        settings: How it is flown.
        start: Where the drone comes from, ENU metres; None for its place of take-off.
        wind: ENU m/s, for the battery; None for none.

    Raises:
        SchedulerError: If the area leaves the fence, enters a no-fly zone or is out of range, or
            the settings make no survey that can be flown.
    """
    width, overlap = settings.strips
    limits, home = robot.limits, np.array(robot.start, dtype=np.float64)
    here = home if start is None else start
    speed = min(settings.speed or limits.cruise_speed, limits.max_speed)
    _check(outline, settings.height, limits, home)
    _check_zones(outline, limits, around=settings.around)
    _check_strips(outline, width * (1.0 - overlap))
    fence = limits.geofence
    plan = cover(
        outline,
        height=settings.height,
        width=settings.width,
        overlap=overlap,
        camera=settings.camera,
        no_fly=fence.no_fly,
        clearance=fence.margin + _TOLERANCE,
        start=(float(here[0]), float(here[1])),
        angle=settings.angle,
        speed=speed,
    )
    if len(plan.waypoints) > MOST_WAYPOINTS:
        raise SchedulerError(
            f"the survey has {len(plan.waypoints)} waypoints, and at most {MOST_WAYPOINTS} are "
            "flown: draw a smaller area, or make the strips wider"
        )
    _check_path(plan.waypoints, limits)
    camera, photos = settings.camera, None
    if camera is not None:
        photos = planned_photos(plan.waypoints, camera, height=settings.height, speed=speed)
    model = EnergyModel(limits.endurance, np.zeros(3) if wind is None else wind)
    return Survey(
        plan.waypoints,
        plan.angle,
        plan.sweeps,
        plan.length,
        _seconds([here, *(one.position for one in plan.waypoints)], speed, limits),
        model.route(here, plan.waypoints, home, speed),
        photos,
    )


def _check(outline: Sequence[Place], height: float, limits: LimitsConfig, home: Vector) -> None:
    """Raise SchedulerError for an area that must not be flown over, before it is planned."""
    least = 3
    if not least <= len(outline) <= MOST_CORNERS:
        raise SchedulerError(f"an area has {least} to {MOST_CORNERS} corners, not {len(outline)}")
    outer = Geofence(limits.geofence.model_copy(update={"no_fly": []}))
    for east, north in outline:
        corner = np.array([east, north, height])
        away = float(np.linalg.norm(corner - home))
        if away > limits.max_range:
            raise SchedulerError(
                f"the area's corner ({east:.1f}, {north:.1f}) is {away:.0f} m away, beyond the "
                f"range of {limits.max_range:g} m"
            )
        if objection := outer.objection(corner):
            raise SchedulerError(f"the area leaves the fence: {objection}")
    area = shapely.Polygon(outline)
    if not area.is_valid or area.area == 0.0:
        raise SchedulerError(
            f"the area encloses nothing or crosses itself: {shapely.is_valid_reason(area)}"
        )
    if outer.inner is not None and not outer.inner.buffer(_TOLERANCE).covers(area):
        raise SchedulerError("the area leaves the fence between two of its corners")


def _check_zones(outline: Sequence[Place], limits: LimitsConfig, *, around: bool) -> None:
    """Raise SchedulerError for an area with a no-fly zone that is not to be flown around."""
    area = shapely.Polygon(outline)
    for zone in () if around else limits.geofence.no_fly:
        shared = area.intersection(shapely.Polygon(zone).buffer(limits.geofence.margin))
        if shared.area > 0.0:
            place = shared.representative_point()
            raise SchedulerError(
                f"the area enters a no-fly zone at ({place.x:.1f}, {place.y:.1f}): draw it "
                "beside, or have it flown around"
            )


def _check_strips(outline: Sequence[Place], apart: float) -> None:
    """Raise SchedulerError for an area of more strips, `apart` metres from one another, than go."""
    longest = float(np.linalg.norm(np.ptp(np.asarray(outline), axis=0)))
    if longest > _MOST_STRIPS * apart:
        raise SchedulerError(
            f"{longest:.0f} m are more than {_MOST_STRIPS} strips that lie {apart:.2g} m apart: "
            "draw a smaller area, or make the strips wider"
        )


def _check_path(waypoints: Sequence[Waypoint], limits: LimitsConfig) -> None:
    """Raise SchedulerError where a path comes nearer to fence or no-fly zones than the margin."""
    inner = Geofence(limits.geofence).inner
    path = shapely.LineString([(one.x, one.y) for one in waypoints] * (2 - (len(waypoints) > 1)))
    if inner is not None and not inner.buffer(_TOLERANCE).covers(path):
        raise SchedulerError(
            "the survey's path comes too near to the fence or a no-fly zone: draw another area"
        )


def _seconds(places: Sequence[Vector], speed: float, limits: LimitsConfig) -> float:
    """Time for a path that is flown at `speed`, with a stop at each of its places."""
    total = 0.0
    for here, there in pairwise(places):
        way = there - here
        upright = abs(float(way[2])) / limits.max_climb
        length = float(np.linalg.norm(way))
        total += max(upright, _leg_seconds(length, speed, limits.max_acceleration))
    return total


def _leg_seconds(length: float, speed: float, acceleration: float) -> float:
    """Time from standstill to standstill, with constant acceleration and braking."""
    if length * acceleration < speed**2:
        return 2.0 * math.sqrt(length / acceleration)
    return length / speed + speed / acceleration
