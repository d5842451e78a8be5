"""One camera, one picture at a time: what is awaited, what was taken, what was lost."""

from __future__ import annotations

from dataclasses import dataclass

from aerodaas.clock import seconds
from aerodaas.errors import VehicleError, failure_line
from aerodaas.messages.payload import Photo, PhotoCamera, PhotoOutcome
from aerodaas.messages.vehicle import PayloadVehicle
from aerodaas.mission.log import MissionLog, words

__all__ = ["NO_CAMERA", "PhotoRequest", "Shutter"]

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


class Shutter:
    """The camera of a vehicle; raises nothing but what `take` says."""

    def __init__(self, vehicle: PayloadVehicle | None, log: MissionLog, timeout: float) -> None:
        """Use `vehicle`'s camera; a picture is awaited for `timeout` seconds. `log` gets alerts."""
        self.photos: list[Photo] = []
        """All pictures taken, in order; the list only grows."""
        self.lost = 0
        """How many pictures were not taken."""
        self._vehicle = vehicle
        self._log = log
        self._timeout = timeout
        self._awaited: dict[int, PhotoRequest] = {}
        """By number."""
        self._told: set[str] = set()
        """Reasons that were told of pictures on the way."""

    @property
    def camera(self) -> PhotoCamera | None:
        """The camera; None without one that answers."""
        return None if self._vehicle is None else self._vehicle.photo_camera

    @property
    def busy(self) -> bool:
        """Whether a picture is awaited."""
        return bool(self._awaited)

    def take(self, label: str, now: int, *, on_the_way: bool = False) -> PhotoRequest:
        """Ask for a picture, for which a waypoint waits or, `on_the_way`, nobody.

        Raises VehicleError and what cameras do.
        """
        camera = self.camera
        if camera is None:
            raise VehicleError(NO_CAMERA)
        request = PhotoRequest(label, now, on_the_way)
        self._awaited[camera.take_photo(label)] = request
        return request

    def trigger(self, label: str, count: int, now: int) -> None:
        """Take one picture on the way, where `count` became due; the others are lost and told."""
        if count > 1:
            self._miss(label, count - 1, _LATE, now)
        if self.busy:
            self._miss(label, 1, _BUSY, now)
            return
        try:
            self.take(label, now, on_the_way=True)
        except VehicleError as error:
            self._miss(label, 1, str(error), now)
        except Exception as error:  # noqa: BLE001 - a driver's camera must not end a flight
            self._miss(label, 1, failure_line(error), now)

    def look(self, now: int) -> None:
        """Take note of pictures that were taken, and of those that failed, at `now` (ns)."""
        try:
            camera = self.camera
            for outcome in () if camera is None else camera.outcomes():
                self._note(outcome, now)
        except Exception as error:  # noqa: BLE001 - a driver's camera must not end a flight
            self._log.alert(now, "photo", f"the camera: {failure_line(error)}")
        for number, request in list(self._awaited.items()):
            if seconds(now - request.asked_at) > self._timeout:
                reason = f"the camera took none within {self._timeout:g} s"
                self._fail(number, request, reason, now)

    def lose(self, label: str, reason: str, now: int) -> None:
        """Count and tell a waypoint's picture that is not taken."""
        self.lost += 1
        self._log.alert(now, "photo", f"{label}: no picture: {reason}")

    def _note(self, outcome: PhotoOutcome, now: int) -> None:
        number = outcome.number
        request = None if number is None else self._awaited.get(number)
        if isinstance(outcome, Photo):
            self.photos.append(outcome)
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
        self.lost += count
        if (subject := words(reason)) not in self._told:
            self._told.add(subject)
            text = f"on the way to {label}: a picture is missed, and more are counted: {reason}"
            self._log.alert(now, "photo", text)
