"""Survey of an area: its path, length, time and battery, or why it cannot be flown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from typing import TYPE_CHECKING

import numpy as np
import shapely

from aerodaas.config.checked import checked
from aerodaas.config.model import CameraConfig, LimitsConfig, RobotConfig, SensorConfig
from aerodaas.config.sections.robot import SIMULATED_INTERVAL
from aerodaas.errors import SchedulerError
from aerodaas.extensions.payload.photo_trigger import PhotoTrigger
from aerodaas.geometry.energy import EnergyModel
from aerodaas.geometry.frames import Vector
from aerodaas.geometry.free_path import Place
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.safety.geofence import Geofence
from aerodaas.schedulers.trajectory.coverage import cover
from aerodaas.schedulers.trajectory.survey_camera import SurveyCamera

if TYPE_CHECKING:
    from aerodaas.environment.robot import Robot

__all__ = [
    "MOST_CORNERS",
    "MOST_PHOTOS",
    "MOST_WAYPOINTS",
    "Survey",
    "SurveyPhotos",
    "SurveySettings",
    "plan_survey",
    "planned_photos",
    "planned_survey",
    "survey_camera",
]

MOST_PHOTOS = 10_000
_SQUARE = 5.0
"""Degrees by which a camera may look beside the vertical, or its picture lie askew to the nose: a
tenth of a usual picture's height, of which the overlap has several times as much to spare."""
_QUARTER, _HALF = 90.0, 180.0


@dataclass(frozen=True)
class SurveyPhotos:
    """Pictures of a survey as they would be taken."""

    places: tuple[Place, ...]
    """Where, metres east and north, in order."""
    spacing: float
    """Metres from one to the next on a line; lines that are cut short have somewhat less."""
    interval: float
    """Seconds from one to the next, at the survey's speed."""
    line_spacing: float
    """Metres between two lines at most."""
    resolution: float | None
    """Metres of ground in a pixel; None where the camera's pixels are not known."""
    too_fast: int
    """How many come sooner than the camera can take them."""
    warning: str
    """The same in words, with the remedy; empty where all can be taken, or nobody knows."""


def survey_camera(
    robot: RobotConfig,
    camera: str | None = None,
    *,
    front_overlap: float = 0.75,
    side_overlap: float = 0.65,
) -> SurveyCamera:
    """Describe a camera of `robot` that surveys, by the environment file.

    Args:
        robot: Who carries it.
        camera: Its id; None for the robot's first camera.
        front_overlap: Share of a picture, 0 to less than 1, that it has in common with the next.
        side_overlap: The same with the one beside it on the next line.

    Raises:
        SchedulerError: If the robot has none of that name, it does not look straight down and
            cannot be turned there, or its view is not known.
        ConfigError: If its settings are none of a camera's.
    """
    sensor = _sensor(robot, camera)
    known = {
        name: sensor.settings[name]
        for name in CameraConfig.model_fields.keys() & sensor.settings.keys()
    }
    settings = checked(CameraConfig, known, f"sensor {sensor.full_id}: settings")
    simulated = (sensor.driver or robot.driver) == "simulated"
    sideways = _lies_sideways(sensor, settings)
    if not simulated and "horizontal_fov" not in known:
        raise SchedulerError(
            f"the view of {sensor.full_id} is not known: give its settings horizontal_fov in "
            "degrees, and width and height of its pictures"
        )
    across, along = (
        math.tan(math.radians(settings.horizontal_fov) / 2.0),
        settings.height / settings.width,
    )
    width, height = settings.width, settings.height
    if sideways:
        width, height = height, width
        across *= along
    return SurveyCamera(
        2.0 * math.atan(across),
        width / height,
        front_overlap,
        side_overlap,
        gimbal=settings.gimbal is not None,
        pixels=width,
        zooms=settings.zoom > 1.0,
        interval=settings.photo_interval or (SIMULATED_INTERVAL if simulated else None),
    )


def _sensor(robot: RobotConfig, camera: str | None) -> SensorConfig:
    cameras = [one for one in robot.sensors if one.type == "camera"]
    if not cameras:
        raise SchedulerError(
            f"{robot.id} has no camera to survey with: name one among its sensors in the "
            "environment file, or give the strips a width"
        )
    sensor = next((one for one in cameras if camera in {None, one.id, one.full_id}), None)
    if sensor is None:
        known = ", ".join(one.id for one in cameras)
        raise SchedulerError(f"{robot.id} has no camera {camera!r}; it has {known}")
    simulated = [one for one in cameras if (one.driver or robot.driver) == "simulated"]
    if sensor in simulated and sensor is not simulated[0]:
        raise SchedulerError(
            f"a simulated drone takes pictures with its first camera, which is {simulated[0].id}, "
            f"not {sensor.id}: survey with that one, or let the file name {sensor.id} first"
        )
    return sensor


def _lies_sideways(sensor: SensorConfig, settings: CameraConfig) -> bool:
    """Whether the wide side of its picture lies along the flight.

    Raises SchedulerError for one that cannot look straight down, or is mounted askew.
    """
    name, gimbal = sensor.full_id, settings.gimbal
    if gimbal is not None:
        if gimbal.lowest > -_QUARTER + _SQUARE:
            raise SchedulerError(
                f"the gimbal of {name} turns down to {gimbal.lowest:g} degrees and not to -90: a "
                "survey is photographed straight down"
            )
        return False
    if settings.pitch < _QUARTER - _SQUARE:
        raise SchedulerError(
            f"{name} looks {settings.pitch:g} degrees down and not straight down: mount it so and "
            'say "pitch": 90 in its settings, or, if it hangs from a gimbal, "gimbal": {}; strips '
            "of a given width need no camera"
        )
    askew = abs(math.remainder(settings.yaw, _QUARTER))
    if askew > _SQUARE:
        raise SchedulerError(
            f"{name} is mounted {settings.yaw:g} degrees to the left, so that its pictures lie "
            "askew to the flight: turn it to 0, 90, -90 or 180"
        )
    return abs(math.remainder(settings.yaw, _HALF)) > _QUARTER / 2.0


def planned_photos(
    waypoints: Sequence[Waypoint], camera: SurveyCamera, *, height: float, speed: float
) -> SurveyPhotos:
    """Pictures that `camera` takes on the lines of a survey.

    Args:
        waypoints: The survey's path, in local ENU.
        camera: The camera, which looks straight down.
        height: Height above the ground, metres.
        speed: Speed on the lines, m/s.

    Raises:
        SchedulerError: If more than `MOST_PHOTOS` are taken.
    """
    gaps: list[float] = []
    places: list[Place] = []
    before: PhotoTrigger | None = None
    for previous, waypoint in pairwise(waypoints):
        trigger = PhotoTrigger(waypoint, previous.position, 0, before)
        if trigger.distance is not None:
            found = trigger.pass_all()
            places += [(float(place[0]), float(place[1])) for place in found]
            goes_on = before is not None and before.distance == trigger.distance
            gaps += [trigger.distance] * (len(found) - (not goes_on))
        if len(places) > MOST_PHOTOS:
            raise SchedulerError(
                f"the survey takes more than {MOST_PHOTOS} pictures: draw a smaller area, fly "
                "higher, or let them overlap less"
            )
        before = trigger
    usual = median(gaps) if gaps else camera.trigger_distance(height)
    fastest = camera.interval or 0.0
    hurried = [one for one in gaps if one < fastest * speed]
    return SurveyPhotos(
        tuple(places),
        usual,
        usual / speed,
        camera.line_spacing(height),
        camera.ground_resolution(height),
        len(hurried),
        _warning(len(hurried), len(places), fastest, min(hurried, default=0.0)),
    )


def _warning(hurried: int, count: int, fastest: float, nearest: float) -> str:
    if not hurried:
        return ""
    slower = math.floor(100.0 * nearest / fastest) / 100.0
    return (
        f"{hurried} of {count} pictures come sooner than the camera can take them, which needs "
        f"{fastest:g} s for one: fly at {slower:g} m/s or slower, higher, or with less overlap "
        "along the line"
    )


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
    `survey_camera`."""

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
        """Survey with `camera` from a height, or from where a pixel is as large as asked.

        Args:
            camera: The camera, which gives strips and distances of pictures.
            height: Height to fly at, metres; or `ground_resolution`.
            ground_resolution: Size of a pixel on the ground, metres; or `height`.
            angle: Of the sweeps, radians counter-clockwise from east; None for the shortest path.
            speed: Speed on the strips, m/s; None for the robot's cruise speed.
            around: Fly around no-fly zones within the area instead of refusing them.

        Raises:
            SchedulerError: If not exactly one of height and resolution is given, or the resolution
                is none.
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
    robot: Robot,
    area: Sequence[tuple[float, float]],
    *,
    height: float | None = None,
    ground_resolution: float | None = None,
    camera: str | None = None,
    front_overlap: float = 0.75,
    side_overlap: float = 0.65,
    angle: float | None = None,
    speed: float | None = None,
    around: bool = False,
) -> Survey:
    """Plan the survey of an area by one of a robot's cameras; nothing is flown.

    `robot.navigate` flies the survey's `waypoints`; its `photos` are the pictures by place.

    Args:
        robot: The robot that flies it.
        area: 3 to 30 corners, metres east and north of the environment's home.
        height: Metres above home; or else `ground_resolution`.
        ground_resolution: Metres of ground in one pixel, from which the height follows.
        camera: Id of a camera that looks straight down or hangs from a gimbal; None for the
            first one.
        front_overlap: Share of a picture, 0 to less than 1, in common with the next one.
        side_overlap: The same with the one beside it on the next line.
        angle: Direction of the lines, radians counter-clockwise from east; None for the
            shortest path.
        speed: m/s; None for the robot's cruise speed.
        around: Whether no-fly zones within the area are flown around, and not refused.

    Raises:
        SchedulerError: If the camera cannot survey, or the area cannot be flown over.
    """
    lens = survey_camera(
        robot.config, camera, front_overlap=front_overlap, side_overlap=side_overlap
    )
    settings = SurveySettings.by_camera(
        lens,
        height=height,
        ground_resolution=ground_resolution,
        angle=angle,
        speed=speed,
        around=around,
    )
    wind = np.array(robot.environment.config.simulation.wind)
    return planned_survey(robot.config, area, settings, wind=wind)


def planned_survey(
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
