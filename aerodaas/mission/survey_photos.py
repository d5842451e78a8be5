"""Pictures of a survey: by which camera of a robot, where, and whether it is fast enough."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median

from aerodaas.config.checked import checked
from aerodaas.config.model import CameraConfig, RobotConfig, SensorConfig
from aerodaas.config.robot import SIMULATED_INTERVAL
from aerodaas.errors import SchedulerError
from aerodaas.geometry.free_path import Place
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.photo_trigger import PhotoTrigger
from aerodaas.schedulers.trajectory.survey_camera import SurveyCamera

__all__ = ["MOST_PHOTOS", "SurveyPhotos", "planned_photos", "survey_camera"]

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
    """Pictures that `camera` takes on the lines of a survey at `height` metres and `speed` m/s.

    Raises SchedulerError for more than `MOST_PHOTOS`.
    """
    gaps: list[float] = []
    places: list[Place] = []
    before: PhotoTrigger | None = None
    for previous, waypoint in pairwise(waypoints):
        trigger = PhotoTrigger(waypoint, previous.position, 0, before)
        if waypoint.trigger_distance is not None:
            found = trigger.pass_all()
            places += [(float(place[0]), float(place[1])) for place in found]
            goes_on = before is not None and before.distance == waypoint.trigger_distance
            gaps += [waypoint.trigger_distance] * (len(found) - (not goes_on))
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
