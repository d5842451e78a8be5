"""Whether motors that stopped did so on the ground, or in the air.

An autopilot calls a disarmed vehicle landed, wherever it is. So a landing is one only if the
vehicle was seen to stand; what was moving, or had not begun to land, falls.
"""

from __future__ import annotations

import math

__all__ = ["Touchdown"]

_LIFTED = 0.5
"""Metres above the place of arming from which it flies."""
_SINKING = 0.35
"""m/s up or down below which it may stand: a landing sinks faster to the end."""
_MOVING = 1.0
"""m/s in all, below which it may stand: an estimate drifts on the ground."""
_STILL = 0.5
"""Seconds of that in a row for it to stand."""
_FRESH = 1.0
"""Seconds for which a position says something of the present."""
_FALLEN = 10.0
"""Seconds after which whatever fell lies."""


class Touchdown:
    """Takes note of positions, landed states and HEARTBEATs; seconds, metres up, m/s."""

    def __init__(self) -> None:
        self.fault = ""
        """What to tell of the latest flight's end, until motors start again."""
        self.falling = False
        """Motors stopped in the air, and it does not lie yet."""
        self.flew = False
        """Whether it has left the ground since motors started."""
        self._armed: bool | None = None
        self._landing = False
        self._on_ground: bool | None = None
        self._up = math.nan
        self._ground = math.nan
        self._still_since = math.inf
        self._moved_at = -math.inf
        self._stopped_at = -math.inf

    def move(self, up: float, rise: float, speed: float, now: float) -> None:
        """Take note of a position: `up` metres, rising at `rise`, moving at `speed` in all."""
        stands = abs(rise) < _SINKING and speed < _MOVING
        self._still_since = min(self._still_since, now) if stands else math.inf
        self._up, self._moved_at = up, now
        self.flew |= self._armed is True and up - self._ground > _LIFTED

    def report(self, *, on_ground: bool | None) -> None:
        """Take note of the autopilot's own word about where it is; None: it does not say."""
        self._on_ground = on_ground
        self.flew |= self._armed is True and on_ground is False

    def observe(self, now: float, *, armed: bool, landing: bool) -> None:
        """Take note of a HEARTBEAT; `landing`: its mode is one that ends on the ground."""
        if armed:
            if not self._armed:
                # Found armed, it is taken to fly: nobody saw it stand.
                self.flew = self._armed is None and self._on_ground is not True
                self._ground = self._up
                self.fault, self.falling = "", False
            self._landing, self._stopped_at = landing, now
        elif self._armed and self.flew and not self._stands(now):
            self.falling = True
            height = self._up - self._ground
            where = f", {height:.0f} m above where they started" if math.isfinite(height) else ""
            self.fault = f"motors: stopped in flight{where}"
        self._armed = armed

    def turn(self, now: float) -> None:
        """See whether it has come to lie."""
        lies = now - self._moved_at < _FRESH and now - self._still_since > 2 * _STILL
        if lies or now - self._stopped_at > _FALLEN:
            self.falling = False

    def _stands(self, now: float) -> bool:
        if now - self._moved_at > _FRESH:
            return self._landing and self._on_ground is not False
        still = now - self._still_since >= _STILL
        return still and (self._landing or self._on_ground is True)
