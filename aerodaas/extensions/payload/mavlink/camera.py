"""A camera by the camera protocol v2: its pictures, its lens, and video on its own card.

Pictures are taken one after the other, each until it is told. That one was taken is told by
CAMERA_IMAGE_CAPTURED, or by ArduPilot's CAMERA_FEEDBACK, with the place that the autopilot had at
its exposure. Where that message is lost on the way, the camera's own count
(CAMERA_CAPTURE_STATUS) tells that it was taken, and no more.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeAlias

from aerodaas.drivers.mavlink.microservices.commander import (
    Commander,
    CommandResult,
    PendingCommand,
)
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import Message
from aerodaas.errors import VehicleError
from aerodaas.extensions.payload.equipment import LensTarget, PhotoFailure, PhotoOutcome
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.payload import CameraStatus, GimbalAttitude, Photo, PhotoPlace

__all__ = ["MavlinkCamera", "MavlinkLens", "MavlinkRecorder", "Moment"]

_START, _STOP = mavlink.MAV_CMD_VIDEO_START_CAPTURE, mavlink.MAV_CMD_VIDEO_STOP_CAPTURE
_SETTLED = 2.0
"""Seconds that a camera has, after its acknowledgement, until its status is to be so."""


class MavlinkRecorder:
    """The recording of one camera; the caller locks.

    Whether it records is told by its acknowledgements, and by CAMERA_CAPTURE_STATUS, which counts
    for more: where it says otherwise, that is a fault.
    """

    def __init__(self, commander: Commander, flags: int) -> None:
        """Command it by `commander`; `flags` are those of its CAMERA_INFORMATION."""
        self.fault = ""
        """Why it refused the last order, or what it says against its own acknowledgement."""
        self.filming: bool | None = None
        """Whether it records, by its newest word; None while that is not known."""
        self._commander = commander
        self._flags = flags
        self._now = -math.inf
        """Second of its newest turn."""
        self._acknowledged: tuple[bool, float] | None = None
        """The order that its status is compared with, and the second of its acknowledgement."""
        self._confirmed = False
        """Whether its status has agreed."""

    @property
    def ending(self) -> bool:
        """Whether it has been told to end, and has not answered."""
        return self._commander.under_way(_STOP) is not None

    @property
    def unconfirmed(self) -> bool:
        """Whether its status has yet to agree with what it has acknowledged."""
        return self._acknowledged is not None and not self._confirmed

    def step(self, now: float) -> None:
        """Let time pass."""
        self._now = now

    def film(self, now: float, *, on: bool) -> None:
        """Have it begin or end.

        Args:
            now: Monotonic clock, seconds.
            on: Whether to record.

        Raises:
            VehicleError: If the camera says that it cannot.
        """
        if self._flags and not self._flags & mavlink.CAMERA_CAP_FLAGS_CAPTURE_VIDEO:
            raise VehicleError("the camera records no video")
        if self.filming is on and not self.fault:
            # By a word that may be old: the next one is compared with it.
            self._expect(now, on=on)
            return
        before, self.filming, self.fault = self.filming, None, ""
        self._acknowledged = None

        def done(outcome: CommandResult) -> None:
            if outcome.replaced:
                return
            if outcome.accepted:
                self.filming = on
                self._expect(self._now, on=on)
            elif outcome.text != "no answer":
                self.filming, self.fault = before, outcome.text

        # A beginning that is repeated after the end would record on.
        self._commander.withdraw(_STOP if on else _START)
        number, what = (_START, "record video") if on else (_STOP, "end the video")
        self._commander.give(PendingCommand(number, (0.0,) * 7, what), done, now=now)

    def _expect(self, now: float, *, on: bool) -> None:
        self._acknowledged, self._confirmed = (on, now), False

    def heed(self, status: CameraStatus, now: float) -> None:
        """Compare with what the camera says that it does.

        Args:
            status: Activity of the camera.
            now: Monotonic clock, seconds.
        """
        if any(self._commander.under_way(number) is not None for number in (_START, _STOP)):
            return
        records = status.recording is not None
        if self._acknowledged is None:
            self.filming = records
            return
        on, since = self._acknowledged
        if records is on:
            self.filming, self._confirmed = records, True
            if not on:
                # What it records from now on is somebody else's.
                self._acknowledged = None
        elif now - since >= _SETTLED:
            self.filming, self._acknowledged = records, None
            doing = "still recording" if records else "not recording"
            self.fault = f"the camera says that it is {doing}"

    def give_up(self) -> None:
        """Give up what a camera that is gone has not answered, and know nothing of it."""
        for number in (_START, _STOP):
            self._commander.withdraw(number)
        self.filming = None


class MavlinkLens:
    """The lens of one camera; the caller locks."""

    def __init__(self, commander: Commander, flags: int) -> None:
        """Command it by `commander`; `flags` are those of its CAMERA_INFORMATION."""
        self.fault = ""
        """Why it did not take the last target, in a few words."""
        self._commander = commander
        self._flags = flags
        self._open: set[int] = set()
        """Commands that are not answered."""

    @property
    def adjusted(self) -> bool:
        """Whether the last target was acknowledged."""
        return not self._open and not self.fault

    def adjust(self, target: LensTarget, now: float) -> None:
        """Have the lens set.

        Args:
            target: Zoom and focus; None leaves one as it is.
            now: Monotonic clock, seconds.

        Raises:
            VehicleError: If the camera says that it has not what is asked.
        """
        zooms = self._flags & mavlink.CAMERA_CAP_FLAGS_HAS_BASIC_ZOOM
        focuses = self._flags & mavlink.CAMERA_CAP_FLAGS_HAS_BASIC_FOCUS
        if self._flags and target.zoom is not None and not zooms:
            raise VehicleError("the camera has no zoom")
        if self._flags and target.focus is not None and not focuses:
            raise VehicleError("the focus of the camera cannot be set")
        self.fault = ""
        if target.zoom is not None:
            kind = float(mavlink.ZOOM_TYPE_RANGE)
            self._command(mavlink.MAV_CMD_SET_CAMERA_ZOOM, kind, target.zoom, "zoom", now)
        if target.focus is not None:
            kind = float(mavlink.FOCUS_TYPE_RANGE)
            self._command(mavlink.MAV_CMD_SET_CAMERA_FOCUS, kind, target.focus, "focus", now)

    def _command(self, number: int, kind: float, value: float, what: str, now: float) -> None:
        def done(outcome: CommandResult) -> None:
            if outcome.replaced:
                return
            self._open.discard(number)
            if not outcome.accepted:
                self.fault = f"{what}: {outcome.text}"

        # A command that replaces another one of its number ends that one first.
        self._commander.give(
            PendingCommand(number, (kind, value, *[0.0] * 5), f"set the {what}"), done, now=now
        )
        self._open.add(number)


Moment: TypeAlias = Callable[[], tuple[int, Odometry | None, GimbalAttitude | None]]
"""Mission clock, vehicle and gimbal now."""

_PATIENCE = 8.0
"""Seconds from a request to the word of its picture."""
_OVERDUE = 2.0
"""Seconds from the camera's word that it takes a picture, after which its count is asked for."""
_MOST = 64
"""Outcomes kept for who does not ask for them."""


@dataclass(slots=True)
class _Request:
    number: int
    label: str
    deadline: float
    before: int | None
    """Pictures that the camera had taken by its own count; None where that is not known."""
    begun_at: float = math.inf
    """Second of its word that it takes the picture."""
    moment: tuple[int, Odometry | None, GimbalAttitude | None] | None = None
    """Mission clock, vehicle and gimbal at that word."""


class MavlinkCamera:
    """One camera; implements `PhotoCamera`. The caller locks."""

    def __init__(
        self,
        commander: Commander,
        lens: MavlinkLens,
        recorder: MavlinkRecorder,
        moment: Moment,
        count: Iterator[int],
    ) -> None:
        """Command it by `commander`; `count` numbers the pictures of all cameras."""
        self.lens = lens
        self.recorder = recorder
        self._commander = commander
        self._moment = moment
        self._count = count
        self._request: _Request | None = None
        self._newest: int | None = None
        self._now = -math.inf
        """Second of its newest turn."""
        self._taken: int | None = None
        """Pictures that the camera has taken by its own count; None before its word of it."""
        self._settled = 0
        """The same, when a picture was last taken for granted by that count."""
        self._outcomes: deque[PhotoOutcome] = deque(maxlen=_MOST)

    def take_photo(self, label: str, now: float) -> int:
        """Ask for one picture; one that is still awaited is given up.

        Args:
            label: Name of the picture.
            now: Monotonic clock, seconds.

        Returns:
            Number of the picture.
        """
        self.give_up("another picture was asked for before it came")
        self._now = now
        number = next(self._count)
        self._request = _Request(number, label, now + _PATIENCE, self._taken)

        def done(outcome: CommandResult) -> None:
            request = self._request
            if request is None or request.number != number:
                return
            if outcome.accepted:
                request.begun_at, request.moment = self._now, self._moment()
            else:
                self._fail(request, f"the camera: {outcome.text}")

        self._commander.give(
            PendingCommand(
                mavlink.MAV_CMD_IMAGE_START_CAPTURE,
                (0.0, 0.0, 1.0, float(number), 0.0, 0.0, 0.0),
                "take a picture",
            ),
            done,
            now=now,
        )
        return number

    @property
    def has_outcomes(self) -> bool:
        """Whether something is to be told."""
        return bool(self._outcomes)

    def outcomes(self) -> list[PhotoOutcome]:
        """Outcomes of pictures since the last call."""
        found = list(self._outcomes)
        self._outcomes.clear()
        return found

    def step(self, now: float) -> None:
        """Give up a picture that is not told."""
        self._now = now
        self.recorder.step(now)
        if self._request is not None and now >= self._request.deadline:
            self._fail(self._request, "the camera does not tell of the picture")

    def give_up(self, reason: str) -> None:
        """Give up a picture that is awaited."""
        if self._request is not None:
            self._fail(self._request, reason)

    def is_overdue(self, now: float) -> bool:
        """Whether the camera took on a picture a while ago, and does not tell of it."""
        return self._request is not None and now - self._request.begun_at >= _OVERDUE

    def compare(self, status: CameraStatus, now: float) -> None:
        """Take an overdue picture for taken where the camera's own count has gone up for it.

        Args:
            status: The camera's own count.
            now: Monotonic clock, seconds.
        """
        request = self._request
        if status.taken is None:
            return
        self._taken = status.taken
        # Its count begins anew with a formatted card.
        self._settled = min(self._settled, status.taken)
        if request is None or request.moment is None or not self.is_overdue(now):
            return
        # Pictures that it takes by itself count, too, and nobody could tell whose one is.
        if request.before is None or status.interval is not None or status.taken <= request.before:
            return
        self._request, self._settled = None, status.taken
        stamp, odometry, gimbal = request.moment
        self._outcomes.append(
            Photo(request.number, stamp, request.label, odometry=odometry, gimbal=gimbal)
        )

    def _fail(self, request: _Request, reason: str) -> None:
        self._request = None
        self._outcomes.append(PhotoFailure(request.number, reason))

    def on_message(self, message: Message) -> None:
        """Process a CAMERA_IMAGE_CAPTURED or a CAMERA_FEEDBACK."""
        told = message.get_type() == "CAMERA_IMAGE_CAPTURED"
        index = int(message.image_index if told else message.img_idx)
        if index == self._newest:
            return
        self._newest = index
        # ArduPilot counts its feedback from 1, cameras their pictures from 0.
        if (index if told else index - 1) < self._settled:
            return
        request = self._request
        if told and message.capture_result != 1:
            if request is not None:
                self._fail(request, "the camera failed to take it")
            return
        self._request = None
        if self._taken is not None:
            self._taken += 1
        if told:
            place = _place(message.lat, message.lon, message.alt / 1e3)
            file = str(message.file_url)
        else:
            place, file = _place(message.lat, message.lng, message.alt_msl), ""
        stamp, odometry, gimbal = self._moment()
        number = None if request is None else request.number
        label = "" if request is None else request.label
        name = file or f"picture {index}"
        self._outcomes.append(Photo(number, stamp, label, place, odometry, gimbal, None, name))


def _place(latitude: float, longitude: float, altitude: float) -> PhotoPlace | None:
    """A place in 1e-7 degrees; None where the camera had none, which says zero or nonsense.

    Its altitude is not known where it is exactly zero.
    """
    known = (latitude or longitude) and math.isfinite(altitude)
    north_pole, date_line = 90.0, 180.0
    lat, lon = latitude / 1e7, longitude / 1e7
    if not known or abs(lat) > north_pole or abs(lon) > date_line:
        return None
    return PhotoPlace(lat, lon, float(altitude) or None, "sea")
