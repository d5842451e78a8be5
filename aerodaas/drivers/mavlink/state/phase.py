"""Flight phase of the vehicle: its HEARTBEAT compared with the requested action.

A mode that was not requested is a pilot's, a ground station's, or the autopilot's own protection:
from then on until it is disarmed no steering message is sent.
"""

from __future__ import annotations

import enum
import math

from aerodaas.types.vehicle import VehicleMode

__all__ = ["FlightMode", "FlightPhase"]

_LAG = 2.5
"""Seconds for which HEARTBEATs may show the previous mode after a change was accepted."""


class FlightMode(enum.Enum):
    """Common flight modes of both autopilots."""

    GUIDED = "guided"
    TAKE_OFF = "take off"
    HOLD = "hold"
    RETURN = "return"
    LAND = "land"
    OTHER = "other"
    """Flown by a pilot, or by the autopilot's own mission."""


_FOLLOWS = {
    FlightMode.GUIDED: frozenset({FlightMode.GUIDED}),
    FlightMode.TAKE_OFF: frozenset({FlightMode.TAKE_OFF, FlightMode.HOLD, FlightMode.GUIDED}),
    FlightMode.HOLD: frozenset({FlightMode.HOLD}),
    FlightMode.RETURN: frozenset({FlightMode.RETURN, FlightMode.LAND}),
    FlightMode.LAND: frozenset({FlightMode.LAND}),
}
"""Modes that belong to each wish."""

_SHOWN = {
    FlightMode.GUIDED: VehicleMode.GUIDED,
    FlightMode.TAKE_OFF: VehicleMode.TAKING_OFF,
    FlightMode.HOLD: VehicleMode.HOLDING,
    FlightMode.RETURN: VehicleMode.RETURNING,
    FlightMode.LAND: VehicleMode.LANDING,
    FlightMode.OTHER: VehicleMode.MANUAL,
}


class FlightPhase:
    """Mode of one vehicle."""

    def __init__(self) -> None:
        self.armed = False
        self.shown = FlightMode.OTHER
        """The mode of the latest HEARTBEAT."""
        self.wish: FlightMode | None = None
        """The last requested action, until it is disarmed."""
        self.seen = False
        """Whether a HEARTBEAT has shown that action."""
        self.taken: VehicleMode | None = None
        """MANUAL or FAILSAFE once another pilot or the autopilot itself flies."""
        self._before: frozenset[FlightMode] = frozenset()
        """Modes that HEARTBEATs may still show for a moment after the request."""
        self._asked_at = -math.inf

    @property
    def mode(self) -> VehicleMode:
        """The mode as the vehicle reports it."""
        if not self.armed:
            return VehicleMode.GROUNDED
        return self.taken or _SHOWN[self.shown]

    def ask(
        self, wish: FlightMode, now: float, meanwhile: frozenset[FlightMode] = frozenset()
    ) -> None:
        """Record a requested mode; HEARTBEATs may show others `meanwhile`."""
        if wish is not self.wish:
            follows = _FOLLOWS[self.wish] if self.wish is not None else frozenset()
            self._before, self.seen = follows | {self.shown} | meanwhile, False
        self.wish, self._asked_at = wish, now

    def rest(self) -> None:
        """Clear the request: the vehicle stands."""
        self.wish, self.seen = None, False

    def observe(self, shown: FlightMode, now: float, *, armed: bool, critical: bool) -> None:
        """Update by a HEARTBEAT."""
        if not armed:
            if self.armed:
                self.wish = self.taken = None
                self.seen = False
            self.armed, self.shown = armed, shown
            return
        self.armed, self.shown = armed, shown
        if self.wish is None or self.taken is not None:
            return
        if shown in _FOLLOWS[self.wish]:
            self.seen = True
            return
        late = now - self._asked_at <= _LAG or not self.seen
        if shown not in self._before or not late:
            self.taken = VehicleMode.FAILSAFE if critical else VehicleMode.MANUAL
