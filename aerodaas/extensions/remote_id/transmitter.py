"""Remote ID by Open Drone ID over MAVLink: what the transmitter is told, and what it objects to.

The autopilot tells the transmitter where the aircraft is; who operates it and from where is ours
to say (https://mavlink.io/en/services/opendroneid.html). The messages go to every component of the
vehicle: an autopilot passes on what it is told, and a transmitter on the same wire hears it itself.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import Message
from aerodaas.extensions.remote_id.settings import RemoteIdConfig

__all__ = ["OperatorPlace", "RemoteId"]

OperatorPlace = tuple[float, float, float | None]
"""Latitude and longitude in degrees, metres above the ellipsoid or None."""

_PERIOD = 1.0
"""Seconds between two messages with the operator's position, as ASTM F3411-22a wants them."""
_SILENT = 3.0
"""Seconds of a transmitter's silence after which it counts as gone, as ArduPilot has it."""
_EPOCH = 1546300800
"""Seconds from the Unix epoch to the standard's, 2019-01-01 00:00 UTC."""
_UNKNOWN_ALTITUDE = -1000.0
_ANYBODY = [0] * 20
"""`id_or_mac` of what is said of the vehicle itself."""
_NUMBER, _TEXT, _ERROR = 20, 23, 50
"""Bytes of a number, of a description and of a transmitter's error."""
_ID_TYPES = {
    "serial": mavlink.MAV_ODID_ID_TYPE_SERIAL_NUMBER,
    "registration": mavlink.MAV_ODID_ID_TYPE_CAA_REGISTRATION_ID,
}
_CATEGORIES = {
    None: mavlink.MAV_ODID_CATEGORY_EU_UNDECLARED,
    "open": mavlink.MAV_ODID_CATEGORY_EU_OPEN,
    "specific": mavlink.MAV_ODID_CATEGORY_EU_SPECIFIC,
    "certified": mavlink.MAV_ODID_CATEGORY_EU_CERTIFIED,
}


class RemoteId:
    """Remote ID of one vehicle; `config` is what is said of it, None for nothing.

    The link's thread calls all but `objection`, under the driver's lock.
    """

    def __init__(self, config: RemoteIdConfig | None, *, observes: bool) -> None:
        """Know of no transmitter yet; who `observes` does not say which aircraft it is.

        A transmitter may keep the first such number for good (ArduPilot's DID_OPTIONS).
        """
        self._config = config
        self._observes = observes
        self._told: dict[int, tuple[float, int, str]] = {}
        """When each component told its status last, the status and its error."""
        self._due = -math.inf
        self._next = 0

    def on_arm_status(self, message: Message, now: float) -> None:
        """Process an OPEN_DRONE_ID_ARM_STATUS.

        Args:
            message: The message.
            now: Monotonic clock, seconds.
        """
        error = _printable(message.error)
        self._told[message.get_srcComponent()] = now, int(message.status), error

    def objection(self, now: float) -> str | None:
        """Reason for which Remote ID is not ready at `now`; empty if it is, None without it."""
        if not self._told:
            return None if self._config is None else "no transmitter is heard"
        for heard_at, status, error in self._told.values():
            if now - heard_at > _SILENT:
                return f"the transmitter has said nothing for {now - heard_at:.0f} s"
            if status != mavlink.MAV_ODID_ARM_STATUS_GOOD_TO_ARM:
                return error or "the transmitter is not ready, and does not say why"
        return ""

    def due_messages(
        self, now: float, place: Callable[[], OperatorPlace | None], target: int
    ) -> list[Message]:
        """The messages that are due at `now`.

        Args:
            now: Monotonic clock, seconds.
            place: Where the vehicle took off, or stands; None while that is not known.
            target: System id of the vehicle.
        """
        if self._config is None or now < self._due:
            return []
        # Kept on average, whatever the turns of the link's thread are.
        self._due = now + _PERIOD if now - self._due > _PERIOD else self._due + _PERIOD
        whole, update = self._place_messages(self._config, place(), target)
        rotation = [whole, *self._static(self._config, target)]
        turn = self._next % len(rotation)
        self._next = turn + 1
        return [whole] if turn == 0 else [update, rotation[turn]]

    def _place_messages(
        self, config: RemoteIdConfig, place: OperatorPlace | None, target: int
    ) -> tuple[Message, Message]:
        """The operator's position, with all that belongs to it, and alone."""
        kind = mavlink.MAV_ODID_OPERATOR_LOCATION_TYPE_TAKEOFF
        if config.operator is not None:
            kind = mavlink.MAV_ODID_OPERATOR_LOCATION_TYPE_FIXED
            stands = config.operator
            place = stands.latitude, stands.longitude, stands.altitude
        # Zero is the protocol's word for a position that is not known.
        latitude, longitude, altitude = (0.0, 0.0, None) if place is None else place
        where = round(latitude * 1e7), round(longitude * 1e7)
        height = _UNKNOWN_ALTITUDE if altitude is None else altitude
        stamp = max(0, int(time.time()) - _EPOCH)
        european = mavlink.MAV_ODID_CLASSIFICATION_TYPE_EU
        undeclared = mavlink.MAV_ODID_CLASSIFICATION_TYPE_UNDECLARED
        whole = mavlink.MAVLink_open_drone_id_system_message(
            *(target, 0, _ANYBODY, kind, european if config.european else undeclared),
            *(*where, 1, 0, _UNKNOWN_ALTITUDE, _UNKNOWN_ALTITUDE),
            *(
                _CATEGORIES[config.category],
                0 if config.uas_class is None else config.uas_class + 1,
            ),
            *(height, stamp),
        )
        update = mavlink.MAVLink_open_drone_id_system_update_message(
            target, 0, *where, height, stamp
        )
        return whole, update

    def _static(self, config: RemoteIdConfig, target: int) -> list[Message]:
        """Messages that do not change: operator, aircraft and purpose, where configured."""
        made: list[Any] = []
        if config.uas_id is not None and not self._observes:
            number = list(config.uas_id.encode().ljust(_NUMBER, b"\0"))
            multicopter = mavlink.MAV_ODID_UA_TYPE_HELICOPTER_OR_MULTIROTOR
            made.append(
                mavlink.MAVLink_open_drone_id_basic_id_message(
                    target, 0, _ANYBODY, _ID_TYPES[config.uas_id_type], multicopter, number
                )
            )
        if config.operator_id is not None:
            operator = config.operator_id.get_secret_value().encode().ljust(_NUMBER, b"\0")
            made.append(
                mavlink.MAVLink_open_drone_id_operator_id_message(
                    target, 0, _ANYBODY, mavlink.MAV_ODID_OPERATOR_ID_TYPE_CAA, operator
                )
            )
        if config.description:
            text = config.description.encode().ljust(_TEXT, b"\0")
            made.append(
                mavlink.MAVLink_open_drone_id_self_id_message(
                    target, 0, _ANYBODY, mavlink.MAV_ODID_DESC_TYPE_TEXT, text
                )
            )
        return made


def _printable(error: str | bytes) -> str:
    """A transmitter's error as far as it can be shown."""
    text = error.decode("ascii", "replace") if isinstance(error, bytes) else error
    shown = "".join(one if one.isprintable() else " " for one in text.partition("\0")[0])
    return " ".join(shown[:_ERROR].split())
