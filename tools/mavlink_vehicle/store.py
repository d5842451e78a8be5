"""What an emulated autopilot keeps: parameters, missions and fences, and the talk about them."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Any

from aerodaas.drivers.mavlink.wire.dialect import mavlink

__all__ = ["LogStore", "ParameterStore", "PlanStore", "TimeKeeper"]

_PACKET = 90
"""Bytes of a LOG_DATA."""
_BEGAN = 1_800_000_000
"""Seconds since the Unix epoch at which every log began."""
_INT, _REAL = mavlink.MAV_PARAM_TYPE_INT32, mavlink.MAV_PARAM_TYPE_REAL32


class ParameterStore:
    """Parameters by name; integers travel by their bytes on PX4, as floats on ArduPilot."""

    def __init__(self, values: dict[str, float], integers: set[str], *, bytewise: bool) -> None:
        self.values = values
        self._integers = integers
        self._bytewise = bytewise

    def handle(self, message: Any) -> list[Any]:  # noqa: ANN401 - pymavlink has no types
        """The answers to PARAM_REQUEST_LIST, PARAM_REQUEST_READ or PARAM_SET.

        None at all if there is no such parameter.
        """
        if message.get_type() == "PARAM_REQUEST_LIST":
            return [self._say(name) for name in self.values]
        name = self._meant(message)
        if name not in self.values:
            return []
        if message.get_type() == "PARAM_SET":
            value = message.param_value
            if self._whole(name):
                (value,) = struct.unpack("<i", struct.pack("<f", value))
            self.values[name] = float(value)
        return [self._say(name)]

    def _meant(self, message: Any) -> str:  # noqa: ANN401
        """By its name, or by its place in the list."""
        index = getattr(message, "param_index", -1)
        if 0 <= index < len(self.values):
            return list(self.values)[index]
        raw = message.param_id
        return raw.decode("ascii", "replace") if isinstance(raw, bytes) else str(raw)

    def _whole(self, name: str) -> bool:
        return name in self._integers and self._bytewise

    def _say(self, name: str) -> Any:  # noqa: ANN401
        value = self.values[name]
        if self._whole(name):
            (value,) = struct.unpack("<f", struct.pack("<i", round(value)))
        kind = _INT if name in self._integers else _REAL
        index = list(self.values).index(name)
        return mavlink.MAVLink_param_value_message(
            name.encode(), value, kind, len(self.values), index
        )


class LogStore:
    """Logs by number, told in packets of 90 bytes."""

    def __init__(self) -> None:
        self.logs: dict[int, bytes] = {}
        self.times: dict[int, int] = {}
        """Seconds since 1970 that are told of them; for want of one, the same of all."""

    def handle(self, message: Any) -> list[Any]:  # noqa: ANN401
        """The answers to LOG_REQUEST_LIST or LOG_REQUEST_DATA."""
        if message.get_type() == "LOG_REQUEST_LIST":
            count, last = len(self.logs), max(self.logs, default=0)
            told = [
                mavlink.MAVLink_log_entry_message(
                    number, count, last, self.times.get(number, _BEGAN), len(content)
                )
                for number, content in self.logs.items()
            ]
            return told or [mavlink.MAVLink_log_entry_message(0, 0, 0, 0, 0)]
        if message.get_type() != "LOG_REQUEST_DATA" or message.id not in self.logs:
            return []
        wanted = self.logs[message.id][message.ofs : message.ofs + message.count]
        return [
            mavlink.MAVLink_log_data_message(
                message.id,
                message.ofs + begin,
                len(wanted[begin : begin + _PACKET]),
                wanted[begin : begin + _PACKET].ljust(_PACKET, b"\0"),
            )
            for begin in range(0, len(wanted), _PACKET)
        ]


class TimeKeeper:
    """Tells its clock since its start, in seconds, by TIMESYNC."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now

    def handle(self, message: Any) -> list[Any]:  # noqa: ANN401
        """The answer to a request; none to an answer."""
        if message.tc1 != 0:
            return []
        return [mavlink.MAVLink_timesync_message(int(self._now() * 1e9), message.ts1)]


class PlanStore:
    """Missions and fences, and one transfer at a time."""

    def __init__(self, *, wants_numbers: bool = False) -> None:
        self._wants_numbers = wants_numbers
        self.plans: dict[int, list[Any]] = {}
        self._coming: list[Any] | None = None
        self._expected = 0
        self._kind = 0

    def handle(self, message: Any) -> list[Any]:  # noqa: ANN401, PLR0911 - one for each kind
        """The answers to one message of the mission protocol."""
        peer = (message.get_srcSystem(), message.get_srcComponent())
        kind, name = message.mission_type, message.get_type()
        held = self.plans.get(kind, [])
        if name == "MISSION_CLEAR_ALL":
            self._clear(kind)
            return [_ack(peer, mavlink.MAV_MISSION_ACCEPTED, kind)]
        if name == "MISSION_REQUEST_LIST":
            return [mavlink.MAVLink_mission_count_message(*peer, len(held), kind)]
        if name == "MISSION_REQUEST_INT":
            if message.seq >= len(held):
                return [_ack(peer, mavlink.MAV_MISSION_INVALID_SEQUENCE, kind)]
            return [_copy(held[message.seq], peer, message.seq)]
        if name == "MISSION_COUNT":
            self._coming, self._expected, self._kind = [], message.count, kind
            return self._next(peer)
        if name == "MISSION_ITEM_INT" and self._coming is not None and kind == self._kind:
            if self._wants_numbers and math.isnan(message.param4):
                self._coming = None
                return [_ack(peer, mavlink.MAV_MISSION_INVALID_PARAM4, kind)]
            if message.seq == len(self._coming):
                self._coming.append(message)
            return self._next(peer)
        return []

    def _clear(self, kind: int) -> None:
        for one in [kind] if kind != mavlink.MAV_MISSION_TYPE_ALL else list(self.plans):
            self.plans.pop(one, None)

    def _next(self, peer: tuple[int, int]) -> list[Any]:
        assert self._coming is not None  # noqa: S101 - a transfer is under way
        if len(self._coming) == self._expected:
            self.plans[self._kind], self._coming = self._coming, None
            return [_ack(peer, mavlink.MAV_MISSION_ACCEPTED, self._kind)]
        wanted = len(self._coming)
        return [mavlink.MAVLink_mission_request_int_message(*peer, wanted, self._kind)]


def _ack(peer: tuple[int, int], result: int, kind: int) -> Any:  # noqa: ANN401
    return mavlink.MAVLink_mission_ack_message(*peer, result, kind)


def _copy(item: Any, peer: tuple[int, int], sequence: int) -> Any:  # noqa: ANN401
    return mavlink.MAVLink_mission_item_int_message(
        *peer,
        sequence,
        item.frame,
        item.command,
        0,
        1,
        *(item.param1, item.param2, item.param3, item.param4),
        *(item.x, item.y, item.z),
        item.mission_type,
    )
