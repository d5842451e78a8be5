"""Flight phase of the vehicle: its HEARTBEAT compared with the requested action.

A mode that was not requested is a pilot's, a ground station's, or the autopilot's own protection:
from then on until it is disarmed no steering message is sent. A request is recorded only as it is
sent, so that a mode which HEARTBEATs show after a silence is never mistaken for one of ours.
"""

from __future__ import annotations

import enum
import math

from aerodaas.messages.vehicle import VehicleMode

__all__ = ["PROTECTIVE", "FlightMode", "FlightPhase"]

_LAG = 2.5
"""Seconds for which HEARTBEATs may show the previous mode after a change was accepted."""
_EXPLAINED = 2.5
"""Seconds after a takeover in which the vehicle may still tell that its own protection did it."""


class FlightMode(enum.Enum):
    """Common flight modes of both autopilots."""

    GUIDED = "guided"
    TAKE_OFF = "take off"
    HOLD = "hold"
    MISSION = "mission"
    """Flying the plan that it holds, by itself."""
    RETURN = "return"
    LAND = "land"
    OTHER = "other"
    """Flown by a pilot."""


PROTECTIVE = frozenset({FlightMode.HOLD, FlightMode.RETURN, FlightMode.LAND})
"""Modes into which an autopilot's own protection changes."""
_FOLLOWS = {
    FlightMode.GUIDED: frozenset({FlightMode.GUIDED}),
    FlightMode.TAKE_OFF: frozenset({FlightMode.TAKE_OFF, FlightMode.GUIDED}),
    FlightMode.HOLD: frozenset({FlightMode.HOLD}),
    FlightMode.MISSION: frozenset({FlightMode.MISSION}),
    FlightMode.RETURN: frozenset({FlightMode.RETURN}),
    FlightMode.LAND: frozenset({FlightMode.LAND}),
}
"""Modes that belong to each wish. Both autopilots land at the end of a return in its own mode."""

_SHOWN = {
    FlightMode.GUIDED: VehicleMode.GUIDED,
    FlightMode.TAKE_OFF: VehicleMode.TAKING_OFF,
    FlightMode.HOLD: VehicleMode.HOLDING,
    FlightMode.RETURN: VehicleMode.RETURNING,
    FlightMode.LAND: VehicleMode.LANDING,
    FlightMode.MISSION: VehicleMode.MISSION,
    FlightMode.OTHER: VehicleMode.MANUAL,
}


class FlightPhase:
    """Mode of one vehicle."""

    def __init__(self) -> None:
        self.armed = False
        self.shown = FlightMode.OTHER
        """The mode of the latest HEARTBEAT."""
        self.wish: FlightMode | None = None
        """The last requested action, until it is disarmed; that of a take-off before it, too."""
        self.seen = False
        """Whether a HEARTBEAT has shown that action."""
        self.taken: VehicleMode | None = None
        """MANUAL or FAILSAFE once another pilot or the autopilot itself has chosen the mode."""
        self._before: frozenset[FlightMode] = frozenset()
        """Modes that HEARTBEATs may still show for a moment after the request."""
        self._asked_at = -math.inf
        self._taken_by = FlightMode.OTHER
        """The mode in which it was taken, and when, in seconds."""
        self._taken_at = -math.inf

    @property
    def mode(self) -> VehicleMode:
        """The mode as the vehicle reports it."""
        if not self.armed:
            return VehicleMode.GROUNDED
        if self.shown is FlightMode.MISSION and not self.flies_plan:
            return self.taken or VehicleMode.MANUAL
        return self.taken or _SHOWN[self.shown]

    @property
    def flies_plan(self) -> bool:
        """Whether it flies the plan that it was asked to fly, or has only just been taken back."""
        ours = self.wish is FlightMode.MISSION or FlightMode.MISSION in self._before
        return self.shown is FlightMode.MISSION and self.taken is None and ours

    @property
    def ours(self) -> bool:
        """Whether it flies for us, and neither returns nor lands."""
        landing = self.wish in {FlightMode.RETURN, FlightMode.LAND}
        return self.armed and self.taken is None and self.wish is not None and not landing

    def ask(
        self, wish: FlightMode, now: float, meanwhile: frozenset[FlightMode] = frozenset()
    ) -> None:
        """Record a requested mode.

        Args:
            wish: The mode.
            now: Monotonic clock, seconds.
            meanwhile: Other modes that HEARTBEATs may show until then.
        """
        if wish is not self.wish:
            follows = _FOLLOWS[self.wish] if self.wish is not None else frozenset()
            self._before, self.seen = follows | {self.shown} | meanwhile, False
        self.wish, self._asked_at = wish, now

    def rest(self) -> None:
        """Clear the request: the vehicle stands."""
        self.wish, self.taken, self.seen = None, None, False

    def observe(
        self,
        shown: FlightMode,
        now: float,
        *,
        armed: bool,
        critical: bool,
        climbed: bool = False,
    ) -> None:
        """Update by a HEARTBEAT.

        Args:
            shown: Its mode.
            now: Monotonic seconds.
            armed: Whether its motors turn.
            critical: Whether the autopilot reports its own protection at work.
            climbed: Whether it is so high that the autopilot may have ended a take-off by a hold.
        """
        if self.armed and not armed:
            self.rest()
        self.armed, self.shown = armed, shown
        if self.taken is VehicleMode.MANUAL and critical and shown is self._taken_by:
            explained = now - self._taken_at <= _EXPLAINED
            self.taken = VehicleMode.FAILSAFE if explained else self.taken
        if self.wish is None or self.taken is not None:
            return
        held = climbed and (self.wish, shown) == (FlightMode.TAKE_OFF, FlightMode.HOLD)
        if held or shown in _FOLLOWS[self.wish]:
            self.seen = True
            return
        late = now - self._asked_at <= _LAG or not self.seen
        if shown not in self._before or not late:
            self.taken = VehicleMode.FAILSAFE if critical else VehicleMode.MANUAL
            self._taken_by, self._taken_at = shown, now
