"""What the autopilot itself says, read off the wire beside the driver: truth, motors, words."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.geometry.frames import GeodeticOrigin

__all__ = ["Witness"]

_TRUTHS = {
    "HIL_STATE_QUATERNION": mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION,
    "SIM_STATE": mavlink.MAVLINK_MSG_ID_SIM_STATE,
}
"""In which message each family's simulator says where the vehicle truly is."""
_EARTH = 1e7
_AGAIN = 2.0
"""Seconds without truth after which it is asked for again: an autopilot forgets at a restart."""


class Witness:
    """Reads all that an autopilot sends; `ask` sends packets to it."""

    def __init__(self, ask: Callable[[bytes], None]) -> None:
        self._ask = ask
        self._reader: Any = mavlink.MAVLink(None)
        self._reader.robust_parsing = True
        self._asker: Any = mavlink.MAVLink(None, 254, 190)
        self._asked_at = self._truth_at = -math.inf
        self._origin: GeodeticOrigin | None = None
        self._ground = 0.0
        self.place: tuple[float, float, float] | None = None
        """ENU metres from where it first stood, by the simulator's own word."""
        self.highest = 0.0
        self.armed = False
        self.armings = 0
        """How often its motors were started."""
        self.modes: list[int] = []
        """The custom modes of its HEARTBEATs, each change once."""
        self.texts: list[str] = []
        self.remote_id: list[Any] = []
        """What it tells a Remote ID transmitter."""

    @property
    def away(self) -> float:
        """Metres over ground from where it first stood."""
        return math.nan if self.place is None else math.hypot(*self.place[:2])

    def take(self, content: bytes) -> list[bytes]:
        """Read bytes that the autopilot has sent; the packets that they complete."""
        packets = []
        for message in self._reader.parse_buffer(content) or []:
            packets.append(bytes(message.get_msgbuf()))
            kind = message.get_type()
            if kind == "HEARTBEAT" and message.autopilot != mavlink.MAV_AUTOPILOT_INVALID:
                self._heartbeat(message)
            elif kind in _TRUTHS:
                self._truth(message)
            elif kind == "STATUSTEXT":
                self.texts.append(str(message.text))
            elif kind.startswith("OPEN_DRONE_ID_"):
                self.remote_id.append(message)
        return packets

    def _heartbeat(self, message: Any) -> None:  # noqa: ANN401 - pymavlink has no types
        armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        self.armings += armed and not self.armed
        self.armed = armed
        if not self.modes or self.modes[-1] != message.custom_mode:
            self.modes.append(message.custom_mode)
        now = time.monotonic()
        if now - self._truth_at > _AGAIN and now - self._asked_at > _AGAIN:
            self._asked_at = now
            px4 = message.autopilot == mavlink.MAV_AUTOPILOT_PX4
            number = _TRUTHS["HIL_STATE_QUATERNION" if px4 else "SIM_STATE"]
            order = mavlink.MAVLink_command_long_message(
                *(message.get_srcSystem(), message.get_srcComponent()),
                *(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, number, 1e5, 0, 0, 0, 0, 0),
            )
            self._ask(order.pack(self._asker))

    def _truth(self, message: Any) -> None:  # noqa: ANN401
        self._truth_at = time.monotonic()
        if message.get_type() == "SIM_STATE":
            latitude, longitude, up = message.lat_int, message.lon_int, message.alt
        else:
            latitude, longitude, up = message.lat, message.lon, message.alt / 1e3
        if self._origin is None:
            self._origin, self._ground = GeodeticOrigin(latitude / _EARTH, longitude / _EARTH), up
        east, north, _ = self._origin.to_local(latitude / _EARTH, longitude / _EARTH, 0.0)
        self.place = (float(east), float(north), up - self._ground)
        self.highest = max(self.highest, self.place[2])
