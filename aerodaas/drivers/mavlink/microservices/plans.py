"""Transfer of missions, fences and rally points (MAVLink's mission protocol)."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import MavlinkLink
from aerodaas.types.errors import VehicleError
from aerodaas.types.geometry import GeodeticOrigin

__all__ = ["DEGREE", "MissionItem", "Progress", "download", "item_place", "upload"]

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
    """`x` and `y` of an item at a place in metres of the local frame, whose ENU origin is known."""
    latitude, longitude, _ = origin.to_geodetic(np.array([east, north, 0.0]))
    return round(latitude * DEGREE), round(longitude * DEGREE)


def _ignore(_: int, __: int) -> None:
    return


def upload(
    link: MavlinkLink,
    items: Sequence[MissionItem],
    kind: int = mavlink.MAV_MISSION_TYPE_MISSION,
    progress: Progress = _ignore,
) -> None:
    """Replace the vehicle's plan by `items`; raises VehicleError with the reason of a failure.

    Blocks; not for use in the link's thread.
    """
    target = link.target
    count = mavlink.MAVLink_mission_count_message(*target, len(items), kind)
    names = ("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK")
    with link.listen(*names) as inbox:
        say: Any = count
        tries = transfers = 0
        while tries < _TRIES and transfers < _TRIES:
            tries += 1
            transfers += say is count
            link.send(say)
            whole = False
            while reply := _next(inbox, kind, _TIMEOUT if say is count else 4 * _ITEM_TIMEOUT):
                if reply.get_type() == "MISSION_ACK":
                    if reply.type == mavlink.MAV_MISSION_ACCEPTED:
                        progress(len(items), len(items))
                        return
                    why = _RESULTS.get(reply.type, f"result {reply.type}")
                    raise VehicleError(f"the autopilot refused the {_name(kind)}: {why}")
                if reply.seq < len(items):
                    tries = 0
                    progress(reply.seq, len(items))
                    say = _message(items[reply.seq], reply.seq, target, kind)
                    link.send(say)
                    whole |= reply.seq == len(items) - 1
            if whole:
                # The acknowledgement was lost; with all items it answers to none of them.
                say = count
    raise VehicleError(f"the autopilot stopped answering while taking the {_name(kind)}")


def download(
    link: MavlinkLink,
    kind: int = mavlink.MAV_MISSION_TYPE_MISSION,
    progress: Progress = _ignore,
) -> list[MissionItem]:
    """The vehicle's plan; raises VehicleError. Blocks; not for use in the link's thread."""
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
