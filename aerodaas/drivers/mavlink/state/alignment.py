"""Alignment of the autopilot's local frame with ours, and its validity.

An autopilot that restarts begins a new local frame, and an estimator that recovers its position
moves the vehicle within the old one. Positions from before and after are never mixed: there is no
position until the frame has been aligned again by the global position.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerodaas.drivers.mavlink.state.frames import LocalFrame
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.errors import VehicleError
from aerodaas.geometry.frames import GeodeticOrigin, Vector, ned_to_enu

__all__ = ["Alignment", "global_origin"]

_STEP = 2.0
"""Metres by which a position may differ from the integrated velocity."""
_ACCELERATION = 10.0
"""m/s² by which the velocity may have changed between two samples."""
_SETTLING = 2.0
"""Seconds for which local and global positions must agree before a frame is valid again."""
_AGREED = 1.5
"""Metres within which they agree."""
_SAME = 3.0
"""Metres within which a new alignment counts as the previous one."""
_TOLD = 10.0
"""Seconds for which a corrected jump is reported."""


@dataclass(frozen=True, slots=True, eq=False)
class _Sample:
    position: Vector
    velocity: Vector
    boot_time: float


class Alignment:
    """Alignment of one connection."""

    def __init__(self, frame: LocalFrame, telemetry: Telemetry) -> None:
        """Start with `frame`, which was aligned by the present `telemetry`.

        Raises VehicleError if it has lost its position since.
        """
        self.frame: LocalFrame | None = frame
        """The frame; None while no position is valid."""
        self.fault = ""
        """Text for the operator; empty if aligned."""
        self._telemetry = telemetry
        self._pinned = frame
        self._reboots = telemetry.reboots
        self.origin = global_origin(telemetry, frame)
        """Geodetic origin of our frame."""
        self.sea_level = _sea_level(telemetry, frame)
        """Metres above mean sea level of our frame's origin, by the autopilot; None: not known."""
        self._last: _Sample | None = None
        self._candidates: list[tuple[float, Vector]] = []
        self._stood_at: Vector | None = None
        self._mended_at = 0.0

    def require_same_boot(self) -> None:
        """Raise VehicleError if the autopilot has restarted since the frame was aligned."""
        if self._telemetry.reboots != self._reboots:
            raise VehicleError(
                "its autopilot started anew while being connected, and its local frame with it; "
                "connect again"
            )

    def move(self) -> None:
        """Update by a new local position."""
        telemetry = self._telemetry
        assert telemetry.position is not None  # noqa: S101 - it is new
        sample = _Sample(telemetry.position, telemetry.velocity, telemetry.boot_time)
        last, self._last = self._last, sample
        if self._stood_at is not None:
            # It stood still while its autopilot started anew.
            self.frame = self._pinned = LocalFrame.standing_at(self._stood_at, sample.position)
            self._stood_at = None
        elif last is not None and (leap := _leap(last, sample)) > 0.0:
            self._lose(f"position: jumped by {leap:.0f} m")

    def restart(self, *, stands: bool) -> None:
        """Handle a restart of the autopilot; `stands`: with still motors, before and after."""
        last, self._last = self._last, None
        if self._stood_at is None and self.frame is not None and last is not None and stands:
            self._stood_at = self.frame.position(last.position)
        self._lose("" if stands else "position: not believed, its local frame is a new one")

    def place(self, now: float, *, sure: bool) -> None:
        """Update by a new global position.

        Args:
            now: Monotonic clock, seconds.
            sure: Whether the estimator reports it as valid.
        """
        telemetry, last = self._telemetry, self._last
        if self.frame is not None:
            if self.fault and now - self._mended_at > _TOLD:
                self.fault = ""
            return
        known = telemetry.place is not None and telemetry.altitude is not None
        fresh = telemetry.knows_place(now)
        if not (known and fresh and sure and last is not None and self.sea_level is not None):
            self._candidates.clear()
            return
        assert telemetry.place is not None  # noqa: S101 - just asked
        assert telemetry.altitude is not None  # noqa: S101 - the same
        east, north, _ = self.origin.to_local(*telemetry.place, self.origin.altitude)
        there = np.array([east, north, telemetry.altitude - self.sea_level])
        self._candidates.append((now, there - ned_to_enu(last.position)))
        self._try(now)

    def _try(self, now: float) -> None:
        found = np.array([origin for _, origin in self._candidates])
        middle = found.mean(axis=0)
        if float(np.linalg.norm(found - middle, axis=1).max()) > _AGREED:
            self._candidates = self._candidates[-1:]
        elif now - self._candidates[0][0] >= _SETTLING:
            same = float(np.linalg.norm(middle - self._pinned.origin)) < _SAME
            self.frame = self._pinned = self._pinned if same else LocalFrame(middle)
            self._mended_at = now

    def _lose(self, fault: str) -> None:
        self.frame = None
        self.fault = fault
        self._candidates.clear()


def _leap(before: _Sample, after: _Sample) -> float:
    """Metres by which a position differs from the integrated velocity; 0 within the tolerance."""
    duration = after.boot_time - before.boot_time
    led = 0.5 * (before.velocity + after.velocity) * duration
    miss = float(np.linalg.norm(after.position - before.position - led))
    return miss if miss > _STEP + 0.5 * _ACCELERATION * duration**2 else 0.0


def global_origin(telemetry: Telemetry, frame: LocalFrame) -> GeodeticOrigin:
    """Geodetic origin of our local frame by the autopilot's own estimate.

    Args:
        telemetry: What the vehicle has told so far.
        frame: Our local frame in the autopilot's.

    Raises:
        VehicleError: If the autopilot has no estimate now.
    """
    place, position = telemetry.whereabouts()
    latitude, longitude, _ = GeodeticOrigin(*place).to_geodetic(-frame.position(position))
    return GeodeticOrigin(latitude, longitude)


def _sea_level(telemetry: Telemetry, frame: LocalFrame) -> float | None:
    """Metres above mean sea level of our frame's origin, by its own estimate."""
    if telemetry.altitude is None or telemetry.position is None:
        return None
    return telemetry.altitude - float(frame.position(telemetry.position)[2])
