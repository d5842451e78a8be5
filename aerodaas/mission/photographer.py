"""Pictures at waypoints: aims the gimbal, waits for it, has the picture taken, tells what failed.

It only asks and looks, and never waits: the setpoint loop goes on while the drone hovers, and with
it all that keeps the drone safe. What a component does not do in time costs its picture and raises
an alert; the drone flies on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from aerodaas.mission.log import MissionLog
from aerodaas.mission.queue import QueuedWaypoint
from aerodaas.types.clock import NANOSECONDS, seconds
from aerodaas.types.errors import VehicleError, failure_line
from aerodaas.types.geometry import wrap_angle
from aerodaas.types.payload import (
    Gimbal,
    GimbalAttitude,
    GimbalTarget,
    Photo,
    PhotoCamera,
    PhotoOutcome,
)
from aerodaas.types.vehicle import PayloadVehicle

__all__ = ["Photographer"]

_AIMED = 0.05
"""Radians of pitch and yaw within which a gimbal looks where it is to: some three degrees, less
than a twentieth of a usual picture."""
_FRESH = NANOSECONDS
"""Nanoseconds for which a gimbal's word counts."""
_AGAIN = 2 * NANOSECONDS
"""Nanoseconds after which a gimbal that is not there yet is told again."""


@dataclass(slots=True)
class _Task:
    """What is to be done at one stop."""

    stop: QueuedWaypoint
    aim: GimbalTarget | None
    """Where the gimbal is to look, within its range; None to leave it."""
    told_at: int | None = None
    """Mission clock at which the gimbal was told, nanoseconds."""
    began: int | None = None
    """Mission clock at arrival, nanoseconds."""
    number: int | None = None
    """That of the picture that was asked for."""
    over: bool = False


class Photographer:
    """Photographer of one mission, called by it once a turn."""

    def __init__(self, vehicle: object, log: MissionLog, timeout: float) -> None:
        """Use gimbal and camera of `vehicle`, if it has any (see `PayloadVehicle`).

        `timeout` in seconds is what both get at a waypoint, together; alerts go to `log`.
        """
        self.photos: list[Photo] = []
        """All pictures taken, in order; the list only grows."""
        self.lost = 0
        """How many waypoints' pictures were not taken."""
        self._vehicle = vehicle if isinstance(vehicle, PayloadVehicle) else None
        self._log = log
        self._timeout = timeout
        self._tasks: dict[str, _Task] = {}
        """By waypoint, so that a stop that was interrupted goes on where it was."""
        self._asked: dict[int, _Task] = {}
        """By the number of the picture that is awaited."""

    def look(self, now: int) -> None:
        """Take note of pictures that were taken, and of those that failed, at `now` (ns)."""
        try:
            camera = self._camera()
            for outcome in () if camera is None else camera.outcomes():
                self._note(outcome, now)
        except Exception as error:  # noqa: BLE001 - a driver's camera must not end a flight
            self._log.alert(now, "photo", f"the camera: {failure_line(error)}")

    def _note(self, outcome: PhotoOutcome, now: int) -> None:
        task = None if outcome.number is None else self._asked.pop(outcome.number, None)
        if isinstance(outcome, Photo):
            self.photos.append(outcome)
            if task is not None:
                task.over = True
        elif task is not None and not task.over:
            self._give_up(task, outcome.reason, now)

    def attend(self, stop: QueuedWaypoint, now: int) -> bool:
        """Do what is due for `stop`, to which the drone flies or at which it is.

        Returns whether the drone has to stay there for it; never for longer than the time-out.
        """
        task = self._tasks.get(stop.id)
        if task is None or task.stop is not stop:
            waypoint = stop.waypoint
            task = self._tasks[stop.id] = _Task(stop, waypoint.gimbal)
            task.over = waypoint.gimbal is None and not waypoint.photo
        if task.over:
            return False
        try:
            self._advance(task, now)
        except VehicleError as error:
            self._give_up(task, str(error), now)
        except Exception as error:  # noqa: BLE001 - a driver's gimbal must not end a flight
            self._give_up(task, failure_line(error), now)
        return not task.over

    def _advance(self, task: _Task, now: int) -> None:
        """Take the next step; raises what the components raise."""
        gimbal = self._gimbal()
        if task.aim is not None and gimbal is None:
            raise VehicleError("the vehicle has no gimbal, or none that answers")
        if task.stop.waypoint.photo and self._camera() is None:
            raise VehicleError("the vehicle has no camera for pictures, or none that answers")
        there = gimbal is None or task.aim is None or self._aims(task, gimbal, now)
        if not task.stop.arrived:
            task.began = None
            return
        task.began = now if task.began is None else task.began
        if seconds(now - task.began) > self._timeout:
            raise VehicleError(self._lateness(task, gimbal, now))
        if task.number is not None or not there:
            return
        camera = self._camera()
        if task.stop.waypoint.photo and camera is not None:
            task.number = camera.take_photo(task.stop.id)
            self._asked[task.number] = task
        else:
            task.over = True

    def _aims(self, task: _Task, gimbal: Gimbal, now: int) -> bool:
        """Whether the gimbal looks where it is to; tells it (again) if not."""
        assert task.aim is not None  # noqa: S101 - asked only then
        attitude = _fresh(gimbal.attitude, now)
        there = attitude is not None and _near(attitude, task.aim)
        untold = task.told_at is None
        if task.told_at is None or (not there and now - task.told_at >= _AGAIN):
            task.told_at = now
            task.aim = gimbal.aim(task.aim)
        return there and not untold

    def _lateness(self, task: _Task, gimbal: Gimbal | None, now: int) -> str:
        """What was missing when time was up."""
        if task.number is not None:
            return f"the camera took none within {self._timeout:g} s"
        attitude = _fresh(gimbal.attitude, now) if gimbal is not None else None
        where = (
            "it does not say where it looks"
            if attitude is None
            else f"it looks at pitch {math.degrees(attitude.pitch):.0f}, "
            f"yaw {math.degrees(attitude.yaw):.0f} degrees"
        )
        why = f": {gimbal.fault}" if gimbal is not None and gimbal.fault else ""
        return f"the gimbal was not there within {self._timeout:g} s; {where}{why}"

    def _give_up(self, task: _Task, reason: str, now: int) -> None:
        task.over = True
        self.lost += task.stop.waypoint.photo
        lost = "no picture" if task.stop.waypoint.photo else "gimbal not aimed"
        self._log.alert(now, "photo", f"{task.stop.id}: {lost}: {reason}")

    def _gimbal(self) -> Gimbal | None:
        return None if self._vehicle is None else self._vehicle.gimbal

    def _camera(self) -> PhotoCamera | None:
        return None if self._vehicle is None else self._vehicle.photo_camera


def _fresh(attitude: GimbalAttitude | None, now: int) -> GimbalAttitude | None:
    """An attitude that is new and finite; a gimbal may say anything."""
    if attitude is None or now - attitude.stamp > _FRESH:
        return None
    return attitude if math.isfinite(attitude.pitch) and math.isfinite(attitude.yaw) else None


def _near(attitude: GimbalAttitude, aim: GimbalTarget) -> bool:
    pitch = abs(wrap_angle(attitude.pitch - aim.pitch))
    return max(pitch, abs(wrap_angle(attitude.yaw - aim.yaw))) <= _AIMED
