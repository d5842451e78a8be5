"""Other aircraft around an emulated vehicle, as its ADS-B receiver tells them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from aerodaas.drivers.mavlink.wire.dialect import mavlink

if TYPE_CHECKING:
    from tools.mavlink_vehicle.firmware import Firmware

__all__ = ["EmulatedAircraft", "EmulatedTraffic"]

_PERIOD = 1.0
"""Seconds between two reports of one aircraft."""
_ALL = (
    mavlink.ADSB_FLAGS_VALID_COORDS
    | mavlink.ADSB_FLAGS_VALID_ALTITUDE
    | mavlink.ADSB_FLAGS_VALID_HEADING
    | mavlink.ADSB_FLAGS_VALID_VELOCITY
    | mavlink.ADSB_FLAGS_VALID_CALLSIGN
    | mavlink.ADSB_FLAGS_VERTICAL_VELOCITY_VALID
)


@dataclass
class EmulatedAircraft:
    """One aircraft that flies straight on; ENU metres and m/s."""

    address: int = 0x4B1234
    callsign: str = "HBXYZ"
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where it is when it is first told."""
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lies: dict[str, Any] = field(default_factory=dict)
    """Fields of its message that are told otherwise."""
    begun: float | None = None
    """Second at which it was first told."""


class EmulatedTraffic:
    """The aircraft of one vehicle's receiver, one with each message, all of them each second."""

    def __init__(self, firmware: Firmware) -> None:
        """Hear nobody yet."""
        self.aircraft: list[EmulatedAircraft] = []
        self._firmware = firmware
        self._next = 0
        self._begun = -math.inf

    def message(self) -> Any | None:  # noqa: ANN401 - pymavlink has no types
        """The next aircraft's ADSB_VEHICLE; None while none is due."""
        now = self._firmware.now
        if self._next >= len(self.aircraft):
            if now - self._begun < _PERIOD:
                return None
            self._next, self._begun = 0, now
        if not self.aircraft:
            return None
        self._next += 1
        return self._report(self.aircraft[self._next - 1], now)

    def _report(self, one: EmulatedAircraft, now: float) -> Any:  # noqa: ANN401
        one.begun = now if one.begun is None else one.begun
        place = np.array(one.position) + np.array(one.velocity) * (now - one.begun)
        latitude, longitude, _ = self._firmware.flight.origin.to_geodetic(place)
        east, north, up = one.velocity
        course = math.degrees(math.atan2(east, north)) % 360.0
        fields = {
            "ICAO_address": one.address,
            "lat": round(latitude * 1e7),
            "lon": round(longitude * 1e7),
            "altitude_type": mavlink.ADSB_ALTITUDE_TYPE_PRESSURE_QNH,
            "altitude": round((self._firmware.options.origin[2] + float(place[2])) * 1e3),
            "heading": round(course * 100) % 36000,
            "hor_velocity": round(math.hypot(east, north) * 100),
            "ver_velocity": round(up * 100),
            "callsign": one.callsign.encode(),
            "emitter_type": mavlink.ADSB_EMITTER_TYPE_LIGHT,
            "tslc": 0,
            "flags": _ALL,
            "squawk": 7000,
        }
        return mavlink.MAVLink_adsb_vehicle_message(**{**fields, **one.lies})
