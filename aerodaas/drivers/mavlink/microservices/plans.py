"""Upload of missions and fences (MAVLink's mission protocol)."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import MavlinkLink
from aerodaas.errors import VehicleError
from aerodaas.geometry.frames import GeodeticOrigin

__all__ = ["DEGREE", "MissionItem", "Upload", "item_place", "upload"]

DEGREE = 1e7
"""Units of an item's `x` and `y` in a degree."""

_TIMEOUT = 1.5
"""Timeout in seconds, and 0.25 within a transfer (MAVLink's recommendation)."""
_ITEM_TIMEOUT = 0.25
_TRIES = 5
_RESULTS = {
    mavlink.MAV_MISSION_UNSUPPORTED_FRAME: "it does not know this frame",
    mavlink.MAV_MISSION_UNSUPPORTED: "it does not know this command",
    mavlink.MAV_MISSION_NO_SPACE: "it has no room for so many",
    mavlink.MAV_MISSION_INVALID: "an item holds a wrong value",
    **{
        mavlink.MAV_MISSION_INVALID_PARAM1 + index: f"parameter {index + 1} of an item is wrong"
        for index in range(7)
    },
    mavlink.MAV_MISSION_INVALID_SEQUENCE: "items came out of order",
    mavlink.MAV_MISSION_DENIED: "it is denied at present",
    mavlink.MAV_MISSION_OPERATION_CANCELLED: "it was cancelled",
}


@dataclass(frozen=True)
class MissionItem:
    """One item; `x` and `y` are degrees times `DEGREE` in global frames."""

    command: int
    values: tuple[float, float, float, float]
    x: int
    y: int
    z: float
    frame: int = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT


def item_place(origin: GeodeticOrigin, east: float, north: float) -> tuple[int, int]:
    """`x` and `y` of an item at a place, degrees times `DEGREE`.

    Args:
        origin: Geodetic origin of the local frame.
        east: Metres in the local frame.
        north: Metres in the local frame.
    """
    latitude, longitude, _ = origin.to_geodetic(np.array([east, north, 0.0]))
    return round(latitude * DEGREE), round(longitude * DEGREE)


class Upload:
    """Upload of one plan: give it messages by `on_message`, and call `step` when it is due."""

    messages: ClassVar[frozenset[str]] = frozenset(
        {"MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK"}
    )
    """Names of the vehicle's messages that belong to it."""

    def __init__(
        self,
        send: Callable[[Any], None],
        target: tuple[int, int],
        items: Sequence[MissionItem],
        kind: int = mavlink.MAV_MISSION_TYPE_MISSION,
        *,
        now: float,
    ) -> None:
        """Begin to replace the plan of `target` (system, component) by `items`, at `now`."""
        self.done = False
        """Whether the vehicle has accepted the plan."""
        self.failure = ""
        """Why it has not; empty as long as it may yet."""
        self.due = now
        """Monotonic seconds at which `step` has something to do."""
        self._send = send
        self._target = target
        self._items = items
        self._kind = kind
        self._count: Any = mavlink.MAVLink_mission_count_message(*target, len(items), kind)
        self._said = self._count
        self._tries = self._transfers = 0
        self._whole = False
        """Whether the last item was sent since something was repeated."""
        self.step(now)

    def on_message(self, message: Any, now: float) -> None:  # noqa: ANN401 - pymavlink has no types
        """Answer a message of the vehicle.

        Args:
            message: The message, one of `messages`.
            now: Monotonic clock, seconds.
        """
        if self.done or self.failure or message.mission_type != self._kind:
            return
        items, name = self._items, _name(self._kind)
        if message.get_type() == "MISSION_ACK":
            self.done = message.type == mavlink.MAV_MISSION_ACCEPTED
            if not self.done:
                why = _RESULTS.get(message.type, f"result {message.type}")
                self.failure = f"the autopilot refused the {name}: {why}"
        elif message.seq < len(items):
            self._tries = 0
            self._said = _message(items[message.seq], message.seq, self._target, self._kind)
            self._whole |= message.seq == len(items) - 1
            self._say(now)

    def step(self, now: float) -> None:
        """Repeat what was said last, if its answer is overdue."""
        if self.done or self.failure or now < self.due:
            return
        if self._whole:
            # The acknowledgement was lost; with all items it answers to none of them.
            self._said = self._count
        if _TRIES in {self._tries, self._transfers}:
            self.failure = f"the autopilot stopped answering while taking the {_name(self._kind)}"
            return
        self._tries += 1
        self._transfers += self._said is self._count
        self._whole = False
        self._say(now)

    def _say(self, now: float) -> None:
        self._send(self._said)
        self.due = now + (_TIMEOUT if self._said is self._count else 4 * _ITEM_TIMEOUT)


def upload(
    link: MavlinkLink, items: Sequence[MissionItem], kind: int = mavlink.MAV_MISSION_TYPE_MISSION
) -> None:
    """Replace the vehicle's plan by `items`; blocks, and is not for use in the link's thread.

    Args:
        link: The link to the vehicle.
        items: Items of the plan, in order.
        kind: MAV_MISSION_TYPE of the plan.

    Raises:
        VehicleError: If the upload failed, for the reason that it gives.
    """
    with link.listen(*Upload.messages) as inbox:
        began = time.monotonic()
        one = Upload(link.send, link.target, items, kind, now=began)
        while not (one.done or one.failure):
            if message := _next(inbox, kind, one.due - time.monotonic()):
                one.on_message(message, time.monotonic())
            one.step(time.monotonic())
    if one.failure:
        raise VehicleError(one.failure)


def _next(inbox: queue.SimpleQueue[Any], kind: int, timeout: float) -> Any | None:  # noqa: ANN401
    deadline = time.monotonic() + timeout
    while (left := deadline - time.monotonic()) > 0.0:
        try:
            message = inbox.get(timeout=left)
        except queue.Empty:
            return None
        if message.mission_type == kind:
            return message
    return None


def _message(item: MissionItem, sequence: int, target: tuple[int, int], kind: int) -> object:
    first = kind == mavlink.MAV_MISSION_TYPE_MISSION and sequence == 0
    return mavlink.MAVLink_mission_item_int_message(
        *target,
        sequence,
        item.frame,
        item.command,
        int(first),
        1,
        *item.values,
        item.x,
        item.y,
        item.z,
        kind,
    )


def _name(kind: int) -> str:
    names = {
        mavlink.MAV_MISSION_TYPE_MISSION: "mission",
        mavlink.MAV_MISSION_TYPE_FENCE: "fence",
    }
    return names.get(kind, f"plan of type {kind}")
