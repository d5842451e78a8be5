"""MAVLink messages: pymavlink's, and PX4's EVENT, which it lacks."""

from __future__ import annotations

import importlib
import struct
from typing import Any, ClassVar

__all__ = ["EventMessage", "decoded", "mavlink"]

mavlink: Any = importlib.import_module("pymavlink.dialects.v20.ardupilotmega")
"""Dialect of both autopilots: the common messages and ArduPilot's own. It has no types."""


class EventMessage(mavlink.MAVLink_message):  # type: ignore[misc]
    """EVENT, PX4's counterpart of STATUSTEXT (common.xml, message 410)."""

    id = 410
    msgname = "EVENT"
    fieldnames: ClassVar[list[str]] = [
        "destination_component",
        "destination_system",
        "id",
        "event_time_boot_ms",
        "sequence",
        "log_levels",
        "arguments",
    ]
    ordered_fieldnames: ClassVar[list[str]] = [
        "id",
        "event_time_boot_ms",
        "sequence",
        "destination_component",
        "destination_system",
        "log_levels",
        "arguments",
    ]
    fieldtypes: ClassVar[list[str]] = [
        *("uint8_t", "uint8_t", "uint32_t", "uint32_t", "uint16_t", "uint8_t", "uint8_t"),
    ]
    fielddisplays_by_name: ClassVar[dict[str, str]] = {}
    fieldenums_by_name: ClassVar[dict[str, str]] = {}
    fieldunits_by_name: ClassVar[dict[str, str]] = {}
    orders: ClassVar[list[int]] = [3, 4, 0, 1, 2, 5, 6]
    lengths: ClassVar[list[int]] = [1, 1, 1, 1, 1, 1, 40]
    array_lengths: ClassVar[list[int]] = [0, 0, 0, 0, 0, 0, 40]
    crc_extra = 160
    unpacker = struct.Struct("<IIHBBB40B")

    def __init__(
        self,
        destination_component: int,
        destination_system: int,
        event: int,
        event_time_boot_ms: int,
        sequence: int,
        log_levels: int,
        arguments: list[int],
    ) -> None:
        """Message with these fields; `event` is the field `id`."""
        super().__init__(self.id, self.msgname)
        self._fieldnames = self.fieldnames
        self._instance_field = None
        self._instance_offset = -1
        self.destination_component = destination_component
        self.destination_system = destination_system
        self.event = event
        self.event_time_boot_ms = event_time_boot_ms
        self.sequence = sequence
        self.log_levels = log_levels
        self.arguments = arguments

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:  # noqa: ANN401, FBT001, FBT002 - pymavlink's signature
        """Serialise.

        Args:
            mav: pymavlink's codec.
            force_mavlink1: As pymavlink passes it.
        """
        payload = self.unpacker.pack(
            self.event,
            self.event_time_boot_ms,
            self.sequence,
            self.destination_component,
            self.destination_system,
            self.log_levels,
            *self.arguments,
        )
        packed: bytes = self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1)
        return packed


mavlink.mavlink_map.setdefault(EventMessage.id, EventMessage)


def decoded(reader: Any, frame: bytearray) -> Any:  # noqa: ANN401 - pymavlink has no types
    """The message in a whole packet; None for one that is damaged or that the dialect lacks.

    Args:
        reader: pymavlink's codec.
        frame: The packet's bytes.
    """
    try:
        message = reader.decode(frame)
    except mavlink.MAVError:
        return None
    return None if message.get_type().startswith("UNKNOWN") else message
