"""Consistency check of the mission's state against the odometry."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from aerodaas.clock import seconds
from aerodaas.geometry.frames import GeodeticOrigin, Vector
from aerodaas.messages.mission import MissionState, MissionStatus
from aerodaas.messages.odometry import GpsFix, Odometry

__all__ = ["Reconciler"]

S = MissionState

_STILL = 0.5
"""Speed in m/s above which the drone is not standing still: hovers in gusts stay below."""
_STUCK = 0.05
"""Speed in m/s below which the drone is not flying anywhere."""
_THERE = 1.5
"""Metres within which the drone loiters at a waypoint."""
_LIFTED = 0.5
"""Metres above the take-off position from which the drone is not on the ground."""
_GROUNDED = 0.1
"""Metres above the take-off position below which the drone is not flying."""


class Reconciler:
    """Compares each odometry with the newest mission state, and with GPS.

    A contradiction is reported after it has lasted for `patience` seconds: states and odometry are
    measured at different moments.
    """

    def __init__(self, patience: float = 2.0, gps_tolerance: float = 10.0) -> None:
        """Report after `patience` seconds; allow GPS to differ by `gps_tolerance` metres."""
        self._patience = patience
        self._gps_tolerance = gps_tolerance
        self._status: MissionStatus | None = None
        self._ground: float | None = None
        self._pinned: tuple[GeodeticOrigin, Vector] | None = None
        self._gps_error = 0.0
        self._since: dict[str, int] = {}

    def observe_status(self, status: MissionStatus) -> None:
        """Store the newest mission status."""
        self._status = status

    def observe_gps(self, fix: GpsFix, odometry: Odometry) -> None:
        """Compare the displacements of GPS and odometry since the first fix.

        Args:
            fix: Latitude and longitude in degrees, altitude in metres.
            odometry: Where the vehicle believes to be at that time.
        """
        if self._pinned is None:
            origin = GeodeticOrigin(fix.latitude, fix.longitude, fix.altitude)
            self._pinned = origin, odometry.position.copy()
            return
        origin, start = self._pinned
        moved = origin.to_local(fix.latitude, fix.longitude, fix.altitude)
        self._gps_error = float(np.linalg.norm(moved[:2] - (odometry.position - start)[:2]))

    def observe_odometry(self, odometry: Odometry, now: int) -> dict[str, str]:
        """Return the contradictions that have lasted: a sentence by kind.

        Args:
            odometry: The vehicle's odometry.
            now: Mission clock, nanoseconds.
        """
        if self._ground is None:
            self._ground = odometry.height
        found = {
            kind: text for kind, check in self._CHECKS.items() if (text := check(self, odometry))
        }
        self._since = {kind: self._since.get(kind, now) for kind in found}
        return {
            kind: text
            for kind, text in found.items()
            if seconds(now - self._since[kind]) >= self._patience
        }

    def _is_in(self, *states: MissionState) -> bool:
        return self._status is not None and self._status.state in states

    def _says(self) -> str:
        return self._status.state.value if self._status is not None else "nothing"

    def _ground_contradiction(self, odometry: Odometry) -> str:
        height = odometry.height - (self._ground or 0.0)
        if self._is_in(S.IDLE, S.PREFLIGHT, S.LANDED) and height > _LIFTED:
            return f"the mission is {self._says()}, yet the drone is {height:.1f} m up"
        if self._is_in(S.ENROUTE, S.LOITERING, S.FOLLOWING, S.HOLDING) and height < _GROUNDED:
            return f"the mission is {self._says()}, yet the drone is on the ground"
        return ""

    def _still_contradiction(self, odometry: Odometry) -> str:
        speed = float(np.linalg.norm(odometry.velocity))
        if self._is_in(S.HOLDING, S.PAUSED, S.LOITERING, S.IDLE, S.LANDED) and speed > _STILL:
            return f"the mission is {self._says()}, yet the drone moves at {speed:.1f} m/s"
        return ""

    def _moving_contradiction(self, odometry: Odometry) -> str:
        speed = float(np.linalg.norm(odometry.velocity))
        moving = self._is_in(S.ENROUTE, S.RETURNING, S.LANDING, S.TAKING_OFF)
        if moving and speed < _STUCK:
            return f"the mission is {self._says()}, yet the drone does not move"
        return ""

    def _place_contradiction(self, odometry: Odometry) -> str:
        target = self._status.target if self._status is not None else None
        if target is None or not self._is_in(S.LOITERING):
            return ""
        distance = float(np.linalg.norm(target.position - odometry.position))
        if distance > _THERE:
            return f"the mission loiters at {target.id}, yet the drone is {distance:.1f} m away"
        return ""

    def _gps_contradiction(self, _: Odometry) -> str:
        if self._gps_error > self._gps_tolerance:
            return f"GPS and odometry differ by {self._gps_error:.1f} m since the first fix"
        return ""

    _CHECKS: dict[str, Callable[[Reconciler, Odometry], str]] = {  # noqa: RUF012 - never changed
        "ground": _ground_contradiction,
        "still": _still_contradiction,
        "moving": _moving_contradiction,
        "place": _place_contradiction,
        "gps": _gps_contradiction,
    }
