"""A camera by the camera protocol v2: one picture after the other, each until it is told.

That a picture was taken is told by CAMERA_IMAGE_CAPTURED, or by ArduPilot's CAMERA_FEEDBACK, with
the place that the autopilot had at its exposure. Where that message is lost on the way, the
camera's own count (CAMERA_CAPTURE_STATUS) tells that it was taken, and no more.
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
from aerodaas.drivers.mavlink.payload.camera_status import CaptureStatus
from aerodaas.drivers.mavlink.payload.lens import MavlinkLens
from aerodaas.drivers.mavlink.payload.video_recorder import MavlinkRecorder
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import Message
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.payload import GimbalAttitude, Photo, PhotoFailure, PhotoOutcome, PhotoPlace

__all__ = ["MavlinkCamera", "Moment"]

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
    """One camera; implements `aerodaas.messages.payload.PhotoCamera`. The caller locks."""

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

    def compare(self, status: CaptureStatus, now: float) -> None:
        """Take an overdue picture for taken where the camera's own count has gone up for it.

        Args:
            status: The camera's own count.
            now: Monotonic clock, seconds.
        """
        request = self._request
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
