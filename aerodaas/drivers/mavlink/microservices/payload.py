"""What a vehicle carries: discovery of gimbal and camera, and their messages, beside the flight.

It is asked for after connecting, and again in flight until it answers or refuses; nothing waits
for it. The link's thread calls `take` and `turn`, the loop's thread the rest, under one lock.
"""

from __future__ import annotations

import math
import time
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import ClassVar

from aerodaas.drivers.mavlink.microservices.commander import (
    Commander,
    CommandResult,
    PendingCommand,
)
from aerodaas.drivers.mavlink.microservices.gimbal import MavlinkGimbal
from aerodaas.drivers.mavlink.microservices.photo_camera import MavlinkCamera
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import Message
from aerodaas.types.clock import Clock
from aerodaas.types.data import Odometry
from aerodaas.types.geometry import yaw_enu_to_ned
from aerodaas.types.payload import (
    Gimbal,
    GimbalAttitude,
    GimbalTarget,
    PhotoCamera,
    PhotoOutcome,
)
from aerodaas.types.vehicle import VehicleState

__all__ = ["Payload"]

_PAUSE = 2.0
"""Seconds between two requests for the same message."""
_REQUESTS = 5
"""Requests for a message that is promised and does not come."""
_RATE = 10.0
"""Attitudes of the gimbal a second."""
_OVERDUE = 3.0
"""Seconds without an attitude after which it is asked for again."""
_GONE = 5.0
"""Seconds without an attitude after which a gimbal that had told one counts as gone."""


@dataclass(slots=True)
class _Search:
    """How far the search for one component is."""

    message: int
    left: int = _REQUESTS
    due: float = -math.inf


class Payload:
    """Gimbal and camera of one vehicle."""

    messages: ClassVar[frozenset[str]] = frozenset(
        {
            *("GIMBAL_MANAGER_INFORMATION", "GIMBAL_DEVICE_ATTITUDE_STATUS"),
            *("CAMERA_INFORMATION", "CAMERA_IMAGE_CAPTURED", "CAMERA_FEEDBACK"),
        }
    )
    """What `take` processes."""

    def __init__(self, clock: Clock, lock: AbstractContextManager[object]) -> None:
        """Know of nothing yet."""
        self.clock = clock
        """The mission's."""
        self._lock = lock
        self._commander: Commander | None = None
        self._gimbal: MavlinkGimbal | None = None
        self._camera: MavlinkCamera | None = None
        self._odometry: Odometry | None = None
        self._searches = [
            _Search(mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_INFORMATION),
            _Search(mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION),
        ]
        self._asked_at = -math.inf

    def search(self, commander: Commander) -> None:
        """Begin to search, by `commander`."""
        self._commander = commander

    @property
    def gimbal(self) -> Gimbal | None:
        """The gimbal; None before it is found, and while it says nothing any more."""
        with self._lock:
            gimbal = self._gimbal
            silent = gimbal is not None and gimbal.silence(time.monotonic()) > _GONE
            return None if gimbal is None or silent else _LockedGimbal(gimbal, self._lock)

    @property
    def camera(self) -> PhotoCamera | None:
        """The camera; None before it is found."""
        return None if self._camera is None else _LockedCamera(self._camera, self._lock)

    def complete(self, state: VehicleState) -> VehicleState:
        """`state` with the gimbal's attitude; it is the newest from now on."""
        self._odometry = state.odometry
        gimbal = self._gimbal
        return state if gimbal is None else replace(state, gimbal=gimbal.attitude)

    def _moment(self) -> tuple[int, Odometry | None, GimbalAttitude | None]:
        gimbal = self._gimbal
        return self.clock.now(), self._odometry, None if gimbal is None else gimbal.attitude

    def take(self, message: Message, now: float) -> None:
        """Process one of `messages`; in the link's thread."""
        if self._commander is None:
            return
        kind = message.get_type()
        if kind == "GIMBAL_MANAGER_INFORMATION":
            if self._gimbal is None:
                self._gimbal = MavlinkGimbal(message, self._commander)
        elif kind == "CAMERA_INFORMATION":
            if self._camera is None:
                self._camera = MavlinkCamera(self._commander, self._moment)
        elif kind == "GIMBAL_DEVICE_ATTITUDE_STATUS":
            if self._gimbal is not None:
                yaw = math.nan if self._odometry is None else self._odometry.yaw
                heading = yaw_enu_to_ned(yaw) if math.isfinite(yaw) else 0.0
                self._gimbal.take(message, now, self.clock.now(), heading)
        elif self._camera is not None:
            self._camera.take(message)

    def turn(self, now: float) -> None:
        """Search on, and see to the gimbal's attitude; in the link's thread."""
        if self._commander is None:
            return
        if self._camera is not None:
            self._camera.turn(now)
        busy = self._commander.under_way(mavlink.MAV_CMD_REQUEST_MESSAGE) is not None
        found = (self._gimbal, self._camera)
        for search, component in zip(self._searches, found, strict=True):
            if component is None and search.left and now >= search.due and not busy:
                self._request(self._commander, search, now)
                return
        self._see_to_attitude(self._commander, now)

    @staticmethod
    def _request(commander: Commander, search: _Search, now: float) -> None:
        search.left -= 1
        search.due = now + _PAUSE

        def done(outcome: CommandResult) -> None:
            if not (outcome.accepted or outcome.replaced) and outcome.text != "no answer":
                search.left = 0

        commander.give(
            PendingCommand(
                mavlink.MAV_CMD_REQUEST_MESSAGE,
                (float(search.message), *[0.0] * 6),
                "tell what it carries",
                insists=False,
            ),
            done,
            now=now,
        )

    def _see_to_attitude(self, commander: Commander, now: float) -> None:
        gimbal = self._gimbal
        if gimbal is None or now - self._asked_at < _OVERDUE:
            return
        number = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        missing = gimbal.heard_at is None or gimbal.silence(now) > _OVERDUE
        # An autopilot takes one such command at a time, and the flight's own come first.
        first = self._asked_at == -math.inf
        if not (missing or first) or commander.under_way(number) is not None:
            return
        self._asked_at = now
        message = float(mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS)
        commander.give(
            PendingCommand(
                number, (message, 1e6 / _RATE, *[0.0] * 5), "tell where the gimbal looks"
            ),
            now=now,
        )


class _LockedGimbal:
    """A gimbal for the loop's thread."""

    def __init__(self, gimbal: MavlinkGimbal, lock: AbstractContextManager[object]) -> None:
        self._gimbal = gimbal
        self._lock = lock

    def aim(self, target: GimbalTarget) -> GimbalTarget:
        """See `Gimbal`."""
        with self._lock:
            return self._gimbal.aim(target, time.monotonic())

    @property
    def attitude(self) -> GimbalAttitude | None:
        """See `Gimbal`."""
        return self._gimbal.attitude

    @property
    def fault(self) -> str:
        """See `Gimbal`."""
        return self._gimbal.fault


class _LockedCamera:
    """A camera for the loop's thread."""

    def __init__(self, camera: MavlinkCamera, lock: AbstractContextManager[object]) -> None:
        self._camera = camera
        self._lock = lock

    def take_photo(self, label: str) -> int:
        """See `PhotoCamera`."""
        with self._lock:
            return self._camera.take_photo(label, time.monotonic())

    def outcomes(self) -> list[PhotoOutcome]:
        """See `PhotoCamera`."""
        with self._lock:
            return self._camera.outcomes()
