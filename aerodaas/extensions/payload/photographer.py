"""Pictures of a mission: aims the gimbal, waits for it, has pictures taken, tells what failed.

It only asks and looks, and never waits: the setpoint loop goes on while the drone hovers, and with
it all that keeps the drone safe. What a component does not do in time costs its picture and raises
an alert; the drone flies on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from aerodaas.clock import NANOSECONDS, seconds
from aerodaas.config.checked import added_settings
from aerodaas.config.sections.robot import RobotConfig
from aerodaas.errors import VehicleError, failure_line
from aerodaas.extensions.payload.actions import AimGimbal, LookAt, SetLens, TakePhoto, TriggerPhotos
from aerodaas.extensions.payload.equipment import (
    Gimbal,
    GimbalTarget,
    LensCamera,
    LensTarget,
    Payload,
    PhotoCamera,
    PhotoOutcome,
)
from aerodaas.extensions.payload.filming import Filming
from aerodaas.extensions.payload.photo_trigger import PhotoTrigger
from aerodaas.extensions.payload.point_of_interest import PointOfInterest, fresh, near
from aerodaas.extensions.payload.settings import PayloadMission
from aerodaas.messages.mission import MissionState
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.payload import Photo
from aerodaas.messages.vehicle import equipment_of
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.action_executor import ActionExecutor, Course
from aerodaas.mission.log import MissionLog, words
from aerodaas.mission.navigation.queue import QueuedWaypoint
from aerodaas.mission.state_machine import TERMINAL

__all__ = ["NO_CAMERA", "PhotoCapture", "PhotoRequest", "Photographer"]

NO_CAMERA = "the vehicle has no camera for pictures, or none that answers"
_BUSY = "the camera was still busy with the one before"
_LATE = "their places were passed before the camera was asked"


@dataclass(eq=False, slots=True)
class PhotoRequest:
    """One picture that was asked for."""

    label: str
    """The waypoint that it is for."""
    asked_at: int
    """Mission clock, nanoseconds."""
    on_the_way: bool = False
    """Whether no waypoint waits for it."""
    photo: Photo | None = None
    """What was taken."""
    failure: str = ""
    """Why nothing was."""


class PhotoCapture:
    """The camera of a vehicle; raises nothing but what `take` says."""

    def __init__(self, payload: Payload | None, log: MissionLog, timeout: float) -> None:
        """Use the camera of `payload`; a picture is awaited for `timeout` seconds.

        `log` gets pictures and alerts.
        """
        self._payload = payload
        self._log = log
        self._timeout = timeout
        self._awaited: dict[int, PhotoRequest] = {}
        """By number."""
        self._told: set[str] = set()
        """Reasons that were told of pictures on the way."""

    @property
    def camera(self) -> PhotoCamera | None:
        """The camera; None without one that answers."""
        return None if self._payload is None else self._payload.photo_camera

    @property
    def busy(self) -> bool:
        """Whether a picture is awaited."""
        return bool(self._awaited)

    def request(self, label: str, now: int, *, on_the_way: bool = False) -> PhotoRequest:
        """Ask for a picture, and await it.

        Args:
            label: Name of the picture, by which the camera and alerts know it.
            now: Mission clock, nanoseconds.
            on_the_way: Whether no waypoint waits for it.

        Raises:
            VehicleError: If there is no camera; beside it comes what cameras raise.
        """
        camera = self.camera
        if camera is None:
            raise VehicleError(NO_CAMERA)
        request = PhotoRequest(label, now, on_the_way)
        self._awaited[camera.take_photo(label)] = request
        return request

    def trigger(self, label: str, count: int, now: int) -> None:
        """Take one picture on the way, where `count` became due; the others are lost and told.

        Args:
            label: Name of the picture.
            count: Pictures that became due.
            now: Mission clock, nanoseconds.
        """
        if count > 1:
            self._miss(label, count - 1, _LATE, now)
        if self.busy:
            self._miss(label, 1, _BUSY, now)
            return
        try:
            self.request(label, now, on_the_way=True)
        except VehicleError as error:
            self._miss(label, 1, str(error), now)
        except Exception as error:  # noqa: BLE001 - a driver's camera must not end a flight
            self._miss(label, 1, failure_line(error), now)

    def poll(self, now: int) -> None:
        """Process the outcomes of pictures at `now` (ns): taken, or failed."""
        try:
            camera = self.camera
            for outcome in () if camera is None else camera.outcomes():
                self._on_outcome(outcome, now)
        except Exception as error:  # noqa: BLE001 - a driver's camera must not end a flight
            self._log.alert(now, "photo", f"the camera: {failure_line(error)}")
        for number, request in list(self._awaited.items()):
            if seconds(now - request.asked_at) > self._timeout:
                reason = f"the camera took none within {self._timeout:g} s"
                self._fail(number, request, reason, now)

    def lose(self, label: str, reason: str, now: int) -> None:
        """Count and tell a waypoint's picture that is not taken.

        Args:
            label: Name of the picture.
            reason: Why it is not taken, as the alert says it.
            now: Mission clock, nanoseconds.
        """
        self._log.photos_lost += 1
        self._log.alert(now, "photo", f"{label}: no picture: {reason}")

    def _on_outcome(self, outcome: PhotoOutcome, now: int) -> None:
        number = outcome.number
        request = None if number is None else self._awaited.get(number)
        if isinstance(outcome, Photo):
            self._log.photos.append(outcome)
            if request is not None and number is not None:
                request.photo = outcome
                del self._awaited[number]
        elif request is not None:
            self._fail(outcome.number, request, outcome.reason, now)

    def _fail(self, number: int, request: PhotoRequest, reason: str, now: int) -> None:
        request.failure = reason
        del self._awaited[number]
        if request.on_the_way:
            self._miss(request.label, 1, reason, now)

    def _miss(self, label: str, count: int, reason: str, now: int) -> None:
        """Count pictures on the way that are not taken; each reason is told once."""
        self._log.photos_lost += count
        if (subject := words(reason)) not in self._told:
            self._told.add(subject)
            text = f"on the way to {label}: a picture is missed, and more are counted: {reason}"
            self._log.alert(now, "photo", text)


_AGAIN = 2 * NANOSECONDS
"""Nanoseconds after which a gimbal that is not there yet is told again."""


@dataclass(slots=True)
class _Task:
    """Pictures on the way to one stop, and at it."""

    stop: QueuedWaypoint
    trigger: PhotoTrigger
    photo: bool
    """Whether a picture is taken at the stop."""
    aim: GimbalTarget | None
    """Where the gimbal is to look, within its range; None to leave it."""
    lens: LensTarget | None
    """Zoom and focus; None to leave them."""
    told_at: int | None = None
    """Mission clock at which the gimbal was told, nanoseconds."""
    began: int | None = None
    """Mission clock at arrival, nanoseconds."""
    request: PhotoRequest | None = None
    """The picture that was asked for."""
    over: bool = False


def _targets(waypoint: Waypoint) -> tuple[bool, GimbalTarget | None, LensTarget | None]:
    """Whether a picture is taken, and targets for gimbal and lens."""
    aim, lens = waypoint.action(AimGimbal), waypoint.action(SetLens)
    return (
        waypoint.action(TakePhoto) is not None,
        None if aim is None else GimbalTarget(aim.pitch, aim.yaw),
        None if lens is None else LensTarget(lens.zoom, lens.focus),
    )


class Photographer(ActionExecutor):
    """Photographer of one mission."""

    order: ClassVar[int] = 1

    def __init__(self, vehicle: object, robot: RobotConfig, log: MissionLog) -> None:
        """Use the `Payload` among the equipment of `vehicle`, if there is one.

        Gimbal and camera get the `photo_timeout` of `robot` at a waypoint, together; alerts go to
        `log`.
        """
        self._payload = equipment_of(vehicle, Payload)
        self._log = log
        self._timeout = timeout = added_settings(robot.mission, PayloadMission).photo_timeout
        self._shutter = PhotoCapture(self._payload, log, timeout)
        self._filming = Filming(self._payload, log, timeout)
        self._point_of_interest = PointOfInterest()
        self._tasks: dict[str, _Task] = {}
        """By waypoint, so that a stop that was interrupted goes on where it was."""
        self._served: _Task | None = None
        self._lens: LensTarget | None = None
        """What the camera's lens was last told."""

    def ongoing(self) -> str:
        """The look at a place."""
        looks = self._point_of_interest.place is not None
        return "the gimbal is kept on a place" if looks else ""

    def steer(self, course: Course, odometry: Odometry, now: int) -> Course:
        """Fly on the line of pictures, with the nose along it or towards the place in view."""
        task, heading = self._served, self._point_of_interest.heading
        course = replace(course, heading=heading)
        if task is None or not np.array_equal(course.place, task.stop.waypoint.position):
            return course
        turns = heading is None and task.stop.waypoint.yaw is None
        ahead = task.trigger.place_ahead(odometry, now, turns=turns)
        if ahead is None:
            return course
        bearing = task.trigger.bearing if heading is None else heading
        return Course(ahead, bearing, brakes=not task.trigger.aligned)

    def stops_at(self, stop: QueuedWaypoint, following: QueuedWaypoint, radius: float) -> bool:
        """Whether a picture by distance is due near the end of the leg, or on the next one."""
        coming = following.waypoint.action(TriggerPhotos)
        if coming is not None and coming.distance is not None:
            return True
        trigger = self._trigger_of(stop)
        return trigger is not None and trigger.ends_with_place(radius)

    def _trigger_of(self, stop: QueuedWaypoint) -> PhotoTrigger | None:
        task = self._tasks.get(stop.id)
        return task.trigger if task is not None and task.stop is stop else None

    def poll(self, now: int) -> None:
        """Process the outcomes of pictures and video at `now` (ns): taken, or failed."""
        self._shutter.poll(now)
        self._filming.poll(now)

    def on_state(self, state: MissionState, now: int) -> None:
        """End a video with the mission."""
        if state in TERMINAL:
            self._filming.end(now)

    def attend(self, stop: QueuedWaypoint, odometry: Odometry, now: int) -> bool:
        """Do what is due for `stop`, to which the drone flies or at which it is.

        Args:
            stop: The stop whose pictures and video are due.
            odometry: Where the drone is.
            now: Mission clock, nanoseconds.

        Returns:
            Whether the drone has to stay there for it; never for longer than the time-out, and then
            as long again for a video.
        """
        return self._photograph(stop, odometry, now) or self._filming.attend(stop, now)

    def _photograph(self, stop: QueuedWaypoint, odometry: Odometry, now: int) -> bool:
        """Do what is due for pictures; returns whether the drone has to stay for it."""
        task = self._task(stop, odometry, now)
        if not stop.arrived:
            task.began = None
        elif task.began is None:
            task.began = now
        self._keep_looking(task, odometry, now)
        awaits = self._trigger(task, odometry, now)
        if task.over:
            return awaits
        try:
            self._advance(task, now)
        except VehicleError as error:
            self._give_up(task, str(error), now)
        except Exception as error:  # noqa: BLE001 - a driver's gimbal must not end a flight
            self._give_up(task, failure_line(error), now)
        return awaits or not task.over

    def _task(self, stop: QueuedWaypoint, odometry: Odometry, now: int) -> _Task:
        """The task of `stop`, which begins where the stop before it was reached."""
        before = self._served
        if before is not None and before.stop is stop:
            return before
        task = self._tasks.get(stop.id)
        waypoint = stop.waypoint
        if task is None or task.stop is not stop:
            # A stop that the drone has left for another one has not arrived any more.
            follows = before is not None and before.stop.arrived
            start = before.stop.waypoint.position if before and follows else odometry.position
            earlier = before.trigger if before and follows else None
            task = _Task(stop, PhotoTrigger(waypoint, start, now, earlier), *_targets(waypoint))
            task.over = task.aim is None and task.lens is None and not task.photo
            self._tasks[stop.id] = task
        self._served = task
        if (look := waypoint.action(LookAt)) is not None:
            self._point_of_interest.at(np.array(look.place))
        elif waypoint.action(AimGimbal) is not None:
            self._point_of_interest.at(None)
        return task

    def _keep_looking(self, task: _Task, odometry: Odometry, now: int) -> None:
        if self._point_of_interest.place is None:
            return
        try:
            self._point_of_interest.aim(self._gimbal(), odometry, now, task.stop.waypoint.yaw)
        except Exception as error:  # noqa: BLE001 - a driver's gimbal must not end a flight
            self._log.alert(now, "photo", f"the gimbal: {failure_line(error)}")

    def _trigger(self, task: _Task, odometry: Odometry, now: int) -> bool:
        """Take the pictures that are due on the way; returns whether one is due at its end yet."""
        trigger, late = task.trigger, False
        if task.began is not None and trigger.awaits:
            late = seconds(now - task.began) > self._timeout
            if self._shutter.busy and not late:
                # Only here there is time to wait for the camera: the drone has arrived.
                return True
        if count := trigger.passed(odometry, now, task.began):
            self._shutter.trigger(task.stop.id, count, now)
        return trigger.awaits and not late

    def _advance(self, task: _Task, now: int) -> None:
        """Take the next step; raises what the components raise."""
        if task.request is not None:
            self._await(task, task.request, now)
            return
        gimbal = self._gimbal()
        if task.aim is not None and gimbal is None:
            raise VehicleError("the vehicle has no gimbal, or none that answers")
        if task.photo and self._shutter.camera is None:
            raise VehicleError(NO_CAMERA)
        lens = self._lens_set(task)
        there = self._point_of_interest.place is None or self._point_of_interest.there
        if gimbal is not None and task.aim is not None:
            there = self._aims(task, gimbal, now)
        if task.began is None:
            return
        if seconds(now - task.began) > self._timeout:
            raise VehicleError(self._lateness(gimbal, now, lens=lens))
        if not (there and lens) or self._shutter.busy:
            return
        if task.photo:
            task.request = self._shutter.request(task.stop.id, now)
        else:
            task.over = True

    def _await(self, task: _Task, request: PhotoRequest, now: int) -> None:
        task.over = request.photo is not None
        if request.failure:
            raise VehicleError(request.failure)
        # The camera's time ends with the stay, of which the gimbal had its part.
        if task.began is not None and seconds(now - task.began) > self._timeout:
            raise VehicleError(f"the camera took none within {self._timeout:g} s")

    def _aims(self, task: _Task, gimbal: Gimbal, now: int) -> bool:
        """Whether the gimbal looks where it is to; tells it (again) if not."""
        assert task.aim is not None  # noqa: S101 - asked only then
        attitude = fresh(gimbal.attitude, now)
        there = attitude is not None and near(attitude, task.aim)
        untold = task.told_at is None
        if task.told_at is None or (not there and now - task.told_at >= _AGAIN):
            task.told_at = now
            task.aim = gimbal.aim(task.aim)
        return there and not untold

    def _lens_set(self, task: _Task) -> bool:
        """Whether the camera's lens is as it is to be; tells it if not, raises what it objects."""
        target = task.lens
        if target is None:
            return True
        camera = self._shutter.camera
        if camera is None:
            raise VehicleError(NO_CAMERA)
        if not isinstance(camera, LensCamera):
            raise VehicleError("the camera has neither zoom nor focus that could be set")
        if target != self._lens:
            self._lens = None
            camera.adjust(target)
            self._lens = target
            return False
        if camera.lens_fault:
            # The same waypoint may ask for it again.
            self._lens = None
            raise VehicleError(f"the camera's lens: {camera.lens_fault}")
        return camera.adjusted

    def _lateness(self, gimbal: Gimbal | None, now: int, *, lens: bool) -> str:
        """Text of what was missing when time was up."""
        if self._shutter.busy:
            return f"the camera was busy for {self._timeout:g} s"
        if not lens:
            return f"the lens was not set within {self._timeout:g} s"
        if gimbal is None:
            return f"the nose did not turn to the place within {self._timeout:g} s"
        attitude = fresh(gimbal.attitude, now)
        where = (
            "it does not say where it looks"
            if attitude is None
            else f"it looks at pitch {math.degrees(attitude.pitch):.0f}, "
            f"yaw {math.degrees(attitude.yaw):.0f} degrees"
        )
        why = f": {gimbal.fault}" if gimbal.fault else ""
        return f"the gimbal was not there within {self._timeout:g} s; {where}{why}"

    def _give_up(self, task: _Task, reason: str, now: int) -> None:
        task.over = True
        if task.photo:
            self._shutter.lose(task.stop.id, reason, now)
        else:
            what = "gimbal not aimed" if task.aim is not None else "lens not set"
            self._log.alert(now, "photo", f"{task.stop.id}: {what}: {reason}")

    def _gimbal(self) -> Gimbal | None:
        return None if self._payload is None else self._payload.gimbal
