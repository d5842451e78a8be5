"""Other aircraft by ADSB_VEHICLE: which are believed, where they are now, and how many were not."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import Message
from aerodaas.extensions.traffic.settings import TrafficConfig
from aerodaas.geometry.frames import GeodeticOrigin, Vector, length
from aerodaas.messages.vehicle import Traffic

__all__ = ["TrafficTable"]

_STALE = 10.0
"""Seconds after which an aircraft that is told no more, each second, is forgotten."""
_MOST = 32
"""Aircraft that are kept, the nearest."""
_ADDRESSES = 1 << 24
_LOWEST, _HIGHEST = -1000.0, 30_000.0
"""Metres above the sea between which something flies that is told by ADS-B."""
_FASTEST = 400.0
"""m/s that a reported aircraft may have; more is no aircraft's."""
_JUMP = 500.0
"""Metres by which two positions may contradict the fastest way between them."""
_CIRCLE = 36000
"""Hundredths of a degree of a full circle."""
_ON_GROUND = {
    mavlink.ADSB_EMITTER_TYPE_EMERGENCY_SURFACE,
    mavlink.ADSB_EMITTER_TYPE_SERVICE_SURFACE,
}


@dataclass(frozen=True, slots=True, eq=False)
class _Report:
    """One aircraft's newest report."""

    callsign: str
    position: Vector
    """ENU metres; NaN for a height that is not known."""
    velocity: Vector
    at: float
    """Second at which it was there."""


class TrafficTable:
    """Table of the aircraft around one vehicle; seconds are monotonic."""

    def __init__(self, config: TrafficConfig) -> None:
        """Know of nothing yet."""
        own = config.own_address
        self._own = None if own is None else int(own, 16)
        self._reports: dict[int, _Report] = {}
        self.heard = False
        """Whether any report has ever come."""
        self.ignored = 0
        """Reports that were not believed: invalid, stale, contradictory, or beyond the number."""

    def update(
        self,
        message: Message,
        now: float,
        origin: GeodeticOrigin,
        sea_level: float | None,
        here: Vector,
    ) -> None:
        """Process an ADSB_VEHICLE.

        Args:
            message: The message; the vehicle's own is ignored.
            now: Monotonic clock, seconds.
            origin: Geodetic origin of our frame.
            sea_level: Height of its zero above the sea, metres; None where it is not known.
            here: The vehicle's own position, ENU metres.
        """
        self.heard = True
        address = int(message.ICAO_address)
        if address == self._own or message.emitter_type in _ON_GROUND:
            return
        report = _report(message, now, origin, sea_level)
        if report is None or self._contradicts(address, report):
            self.ignored += 1
            return
        self._forget(now)
        self._reports[address] = report
        if len(self._reports) > _MOST:
            del self._reports[max(self._reports, key=lambda one: self._away(one, here, now))]
            self.ignored += 1

    def around(self, here: Vector, now: float) -> tuple[Traffic, ...]:
        """All that is known, the nearest to `here` first.

        Args:
            here: ENU metres.
            now: Monotonic clock, seconds.
        """
        self._forget(now)
        return tuple(
            Traffic(
                address,
                one.callsign,
                one.position + one.velocity * (now - one.at),
                one.velocity,
                now - one.at,
            )
            for address, one in sorted(
                self._reports.items(), key=lambda item: self._away(item[0], here, now)
            )
        )

    def _away(self, address: int, here: Vector, now: float) -> float:
        one = self._reports[address]
        way = one.position + one.velocity * (now - one.at) - here
        # NaN stands for what is not known: as near as it can be.
        return length(np.nan_to_num(way))

    def _forget(self, now: float) -> None:
        reports = self._reports
        self._reports = {key: one for key, one in reports.items() if now - one.at <= _STALE}

    def _contradicts(self, address: int, report: _Report) -> bool:
        """Whether it cannot have come here from where it was last, or is older than that."""
        last = self._reports.get(address)
        if last is None or report.at - last.at > _STALE:
            return False
        duration = report.at - last.at
        way = length(report.position[:2] - last.position[:2])
        return duration < 0.0 or way > _FASTEST * duration + _JUMP


def _report(
    message: Message, now: float, origin: GeodeticOrigin, sea_level: float | None
) -> _Report | None:
    """Report in a message; None for one without a usable place."""
    flags = message.flags
    places = flags & mavlink.ADSB_FLAGS_VALID_COORDS
    nowhere = message.lat == 0 and message.lon == 0
    on_earth = abs(message.lat) <= 90 * 10**7 and abs(message.lon) <= 180 * 10**7
    named = 0 < message.ICAO_address < _ADDRESSES
    if not (places and on_earth and named) or nowhere or message.tslc > _STALE:
        return None
    altitude = message.altitude / 1e3 if flags & mavlink.ADSB_FLAGS_VALID_ALTITUDE else math.nan
    if altitude < _LOWEST or altitude > _HIGHEST:
        return None
    velocity = _velocity(message)
    if velocity is None:
        return None
    east, north, _ = origin.to_local(message.lat / 1e7, message.lon / 1e7, origin.altitude)
    up = math.nan if sea_level is None else altitude - sea_level
    callsign = _callsign(message) or f"{message.ICAO_address:06X}"
    return _Report(callsign, np.array([east, north, up]), velocity, now - message.tslc)


def _velocity(message: Message) -> Vector | None:
    """ENU m/s, zero where they are not told; None if they are no aircraft's."""
    flags, velocity = message.flags, np.zeros(3)
    if flags & mavlink.ADSB_FLAGS_VALID_HEADING and flags & mavlink.ADSB_FLAGS_VALID_VELOCITY:
        if message.heading > _CIRCLE:
            return None
        course, speed = math.radians(message.heading / 100), message.hor_velocity / 100
        velocity[:2] = speed * math.sin(course), speed * math.cos(course)
    if flags & mavlink.ADSB_FLAGS_VERTICAL_VELOCITY_VALID:
        velocity[2] = message.ver_velocity / 100
    return velocity if length(velocity) <= _FASTEST else None


def _callsign(message: Message) -> str:
    """Its callsign as far as it can be shown; empty without one."""
    if not message.flags & mavlink.ADSB_FLAGS_VALID_CALLSIGN:
        return ""
    text = str(message.callsign).partition("\0")[0]
    return "".join(one for one in text if one.isascii() and one.isalnum())
