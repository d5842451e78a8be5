"""Readings of a rangefinder that looks down (DISTANCE_SENSOR, common.xml 132)."""

from __future__ import annotations

import math
from typing import Any

from aerodaas.drivers.mavlink.state.frames import Attitude
from aerodaas.drivers.mavlink.wire.dialect import mavlink

__all__ = ["RATE", "Rangefinder"]

RATE = 10.0
"""Readings a second that are asked for, where the robot's limits need them."""
_FRESH = 0.5
"""Seconds for which a reading counts."""
_SILENT = 2.0
"""Seconds without a message after which the rangefinder has failed."""
_INVALID = 1
"""Value of `signal_quality` of a reading that is none."""
_LEVEL = math.radians(45)
"""Tilt from which on it looks at something else than what is below."""


class Rangefinder:
    """The newest reading; arrival times in monotonic seconds."""

    def __init__(self) -> None:
        self._heard_at = self._read_at = -math.inf
        self._metres = math.nan

    def on_message(self, message: Any, now: float) -> None:  # noqa: ANN401 - pymavlink has no types
        """Update by a DISTANCE_SENSOR; those that look elsewhere are not heeded.

        Args:
            message: The message.
            now: Monotonic clock, seconds.
        """
        if message.orientation != mavlink.MAV_SENSOR_ROTATION_PITCH_270:
            return
        self._heard_at = now
        read = message.current_distance
        if read > message.max_distance:
            self._read_at = -math.inf
        elif message.signal_quality != _INVALID and read > 0:
            # Nearer than it can measure is near. Zero is what many send for "nothing seen", which
            # for a moment leaves what was seen before.
            self._metres, self._read_at = read / 100, now

    def below(self, attitude: Attitude, now: float) -> float | None:
        """Metres straight down to whatever is there; None without a reading that counts.

        Args:
            attitude: The vehicle's, by which the reading is made upright.
            now: Monotonic clock, seconds.
        """
        upright = math.cos(attitude.roll) * math.cos(attitude.pitch)
        if now - self._read_at > _FRESH or upright < math.cos(_LEVEL):
            return None
        return self._metres * upright

    def fault(self, now: float) -> str:
        """Fault of the rangefinder for the operator; empty if there is none."""
        silence = now - self._heard_at
        if silence <= _SILENT:
            return ""
        since = f" for {silence:.0f} s" if math.isfinite(silence) else ""
        return f"rangefinder: no word from it{since}, which limits.rangefinder_clearance relies on"
