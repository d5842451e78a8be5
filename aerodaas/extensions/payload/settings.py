"""Time that gimbal and camera get in a mission."""

from __future__ import annotations

from aerodaas.config.checked import Positive, Strict

__all__ = ["PayloadMission"]


class PayloadMission(Strict):
    """Gimbal and camera in a mission."""

    photo_timeout: Positive = 10.0
    """Seconds that gimbal and camera get at a waypoint; then the drone flies on without them."""
