"""Touchdown detection: whether motors stopped on the ground or in the air.

An autopilot reports a disarmed vehicle as landed, wherever it is. So a landing counts only if the
vehicle was seen to stand; one that was moving, or had not begun to land, falls. A vehicle that came
down while the link was silent is not counted as fallen.
"""

from __future__ import annotations

import math

from aerodaas.drivers.mavlink.state.phase import FlightMode
from aerodaas.messages.vehicle import FlightEnd

__all__ = ["Touchdown"]

_LIFTED = 0.5
"""Metres above the place of arming above which it flies."""
_SINKING = 0.35
"""m/s up or down below which it may stand: a landing sinks faster to the end."""
_MOVING = 1.0
"""m/s in all, below which it may stand: an estimate drifts on the ground."""
_STILL = 0.5
"""Seconds of that in a row for it to stand."""
_NEAR = 1.0
"""Metres above the place of arming at which a return may have ended."""
_FRESH = 1.0
"""Seconds for which a position counts as present."""
_LATE = 2.5
"""Seconds by which a HEARTBEAT with the motors' state may be late, as one may be lost."""
_SAID = 1.8
"""Seconds of its own report for it to stand though its estimate moves: a vehicle stopped in the air
reports so, too, but is reported as disarmed within a second."""
_FALLS = 2.0
"""m/s downwards at which it does not stand, even if it reports so."""
_FALLEN = 10.0
"""Seconds after which a fallen vehicle lies still."""


class Touchdown:
    """Detector fed with positions, landed states and HEARTBEATs; seconds, metres up, m/s."""

    def __init__(self) -> None:
        self.fault = ""
        """The reported end of the latest flight, until motors start again."""
        self.falling = False
        """Whether motors stopped in the air and it has not come to rest yet."""
        self.ended: FlightEnd | None = None
        """End of the latest flight; None before and during one."""
        self.flew = False
        """Whether it has left the ground since motors started."""
        self._armed: bool | None = None
        self._mode = FlightMode.OTHER
        self._on_ground: bool | None = None
        self._on_ground_since = math.inf
        self._up = math.nan
        self._ground = math.nan
        self._still_since = math.inf
        self._moved_at = self._back_at = self._fell_at = -math.inf
        self._unheard_at = -math.inf
        """Time at which it was found disarmed, after a silence of the link."""
        self._rise = 0.0
        self._stopped_at = -math.inf
        self._blind = False
        """Forget positions, because the autopilot has restarted."""

    def move(self, up: float, rise: float, speed: float, now: float) -> None:
        """Update by a position.

        Args:
            up: Height, metres.
            rise: Climb rate, m/s.
            speed: Total speed, m/s.
            now: Monotonic clock, seconds.
        """
        if now - self._moved_at > _FRESH:
            self._back_at = now
        if rise < -_FALLS:
            self._fell_at = now
            if now - self._unheard_at < _LATE:
                self._fall()
        stands = abs(rise) < _SINKING and speed < _MOVING
        self._still_since = min(self._still_since, now) if stands else math.inf
        self._up, self._rise, self._moved_at = up, rise, now
        self.flew |= self._armed is True and up - self._ground > _LIFTED

    def report(self, now: float, *, on_ground: bool | None) -> None:
        """Update by the autopilot's own landed state.

        Args:
            now: Monotonic clock, seconds.
            on_ground: Whether it says so; None if it sends none.
        """
        self._on_ground = on_ground
        self._on_ground_since = min(self._on_ground_since, now) if on_ground else math.inf
        self.flew |= self._armed is True and on_ground is False

    def observe(self, mode: FlightMode, now: float, *, armed: bool) -> None:
        """Update by a HEARTBEAT.

        Args:
            mode: Flight mode that it shows.
            now: Monotonic clock, seconds.
            armed: Whether the vehicle is armed by it.
        """
        if armed:
            if not self._armed:
                # Found armed, it counts as flying: it was not seen to stand.
                self.flew = self._armed is None and self._on_ground is not True
                self._ground = self._up
                self.fault, self.falling, self._blind = "", False, False
                self.ended, self._unheard_at = None, -math.inf
            self._mode, self._stopped_at = mode, now
        elif self._armed and self.flew:
            self._end(now)
        self._armed = armed

    def restart(self, now: float) -> None:
        """Handle a restart of the autopilot: no motor turns meanwhile."""
        if self._armed and self.flew:
            self._fall()
            self._stopped_at = now
        self._armed, self._blind = False, True

    def _end(self, now: float) -> None:
        unheard = now - self._moved_at > _FRESH or now - self._back_at < _LATE
        if unheard and now - self._fell_at > _LATE:
            self.ended, self._unheard_at = FlightEnd.UNHEARD, now
        elif self._stands(now):
            self.ended = FlightEnd.LANDED
        else:
            self._fall()

    def _fall(self) -> None:
        self.falling, self.ended, self._unheard_at = True, FlightEnd.FELL, -math.inf
        self._still_since = math.inf
        height = self._up - self._ground
        where = f", {height:.0f} m above where they started" if math.isfinite(height) else ""
        self.fault = f"motors: stopped in flight{where}"

    def update(self, now: float) -> None:
        """Check whether it has come to rest."""
        lies = now - self._moved_at < _FRESH and now - self._still_since > 2 * _STILL
        if (lies and not self._blind) or now - self._stopped_at > _FALLEN:
            self.falling = False

    def _stands(self, now: float) -> bool:
        """Whether it stood on the ground in the mode that it had when its motors stopped."""
        if now - self._fell_at < _LATE:
            return False
        said = now - self._on_ground_since
        if now - self._still_since < _STILL:
            return said >= _SAID and self._rise > -_FALLS
        if self._mode is FlightMode.LAND:
            return True
        if self._mode is FlightMode.RETURN and self._up - self._ground < _NEAR:
            return True
        # A vehicle that has just been stopped in the air reports this, too, and soon falls.
        return said >= _STILL
