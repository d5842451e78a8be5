"""Transfer of missions, fences and rally points (MAVLink's mission protocol)."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import MavlinkLink
from aerodaas.errors import VehicleError
from aerodaas.geometry.frames import GeodeticOrigin

__all__ = ["DEGREE", "MissionItem", "Progress", "Upload", "download", "item_place", "upload"]

DEGREE = 1e7
"""Units of an item's `x` and `y` in a degree."""

_TIMEOUT = 1.5
"""Timeout in seconds, and 0.25 within a transfer (MAVLink's recommendation)."""
_ITEM_TIMEOUT = 0.25
_TRIES = 5
_MOST = 2000
"""Most items accepted."""
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

Progress = Callable[[int, int], None]
"""Called with the number of transferred items and of all."""


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


def _ignore(_: int, __: int) -> None:
    return


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
        progress: Progress = _ignore,
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
        self._progress = progress
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
            if self.done:
                self._progress(len(items), len(items))
            else:
                why = _RESULTS.get(message.type, f"result {message.type}")
                self.failure = f"the autopilot refused the {name}: {why}"
        elif message.seq < len(items):
            self._tries = 0
            self._progress(message.seq, len(items))
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
    link: MavlinkLink,
    items: Sequence[MissionItem],
    kind: int = mavlink.MAV_MISSION_TYPE_MISSION,
    progress: Progress = _ignore,
) -> None:
    """Replace the vehicle's plan by `items`; blocks, and is not for use in the link's thread.

    Args:
        link: The link to the vehicle.
        items: Items of the plan, in order.
        kind: MAV_MISSION_TYPE of the plan.
        progress: Called with the number of items uploaded and of all items.

    Raises:
        VehicleError: If the upload failed, for the reason that it gives.
    """
    with link.listen(*Upload.messages) as inbox:
        began = time.monotonic()
        one = Upload(link.send, link.target, items, kind, progress=progress, now=began)
        while not (one.done or one.failure):
            if message := _next(inbox, kind, one.due - time.monotonic()):
                one.on_message(message, time.monotonic())
            one.step(time.monotonic())
    if one.failure:
        raise VehicleError(one.failure)


def download(
    link: MavlinkLink,
    kind: int = mavlink.MAV_MISSION_TYPE_MISSION,
    progress: Progress = _ignore,
) -> list[MissionItem]:
    """The vehicle's plan; blocks, and is not for use in the link's thread.

    Args:
        link: The link to the vehicle.
        kind: MAV_MISSION_TYPE of the plan.
        progress: Called with the number of items downloaded and of all items.

    Raises:
        VehicleError: If the vehicle does not answer, or says that the plan has too many items.
    """
    target = link.target
    with link.listen("MISSION_COUNT", "MISSION_ITEM_INT") as inbox:
        ask: Any = mavlink.MAVLink_mission_request_list_message(*target, kind)
        reply = _ask(link, inbox, ask, kind, lambda one: one.get_type() == "MISSION_COUNT")
        total = reply.count
        if total > _MOST:
            raise VehicleError(f"the autopilot says that its {_name(kind)} has {total} items")
        items: list[MissionItem] = []
        for index in range(total):
            ask = mavlink.MAVLink_mission_request_int_message(*target, index, kind)
            reply = _ask(link, inbox, ask, kind, partial(_is_item, index))
            values = (reply.param1, reply.param2, reply.param3, reply.param4)
            items.append(MissionItem(reply.command, values, reply.x, reply.y, reply.z, reply.frame))
            progress(index + 1, total)
    link.send(mavlink.MAVLink_mission_ack_message(*target, mavlink.MAV_MISSION_ACCEPTED, kind))
    return items


def _is_item(index: int, message: Any) -> bool:  # noqa: ANN401 - pymavlink has no types
    return bool(message.get_type() == "MISSION_ITEM_INT" and message.seq == index)


def _ask(
    link: MavlinkLink,
    inbox: queue.SimpleQueue[Any],
    request: object,
    kind: int,
    fits: Callable[[Any], bool],
) -> Any:  # noqa: ANN401 - pymavlink has no types
    for _ in range(_TRIES):
        link.send(request)
        while (reply := _next(inbox, kind, _TIMEOUT)) is not None:
            if fits(reply):
                return reply
    raise VehicleError(f"the autopilot does not answer when asked for its {_name(kind)}")


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
        mavlink.MAV_MISSION_TYPE_RALLY: "rally points",
    }
    return names.get(kind, f"plan of type {kind}")
