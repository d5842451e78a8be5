"""Where the vehicle is by its own estimate and by GPS, and the state of its battery.

Positions and velocities are ENU, metres and m/s; angles are radians (see
`aerodaas.geometry.frames`).
"""

from __future__ import annotations

from dataclasses import dataclass

from aerodaas.geometry.frames import Vector
from aerodaas.messages.serialization.json_types import Int64, Real
from aerodaas.messages.serialization.records import fast_pickle

__all__ = ["Battery", "GpsFix", "Odom", "Odometry"]


@fast_pickle
@dataclass(frozen=True, slots=True)
class Odometry:
    """Where the vehicle believes it is: ENU position and velocity, attitude and body rates."""

    position: Vector
    """Metres, ENU, from home."""
    velocity: Vector
    """m/s, ENU."""
    yaw: Real
    """Radians, counter-clockwise from east."""
    roll: Real = 0.0
    """Radians, positive with the right side down."""
    pitch: Real = 0.0
    """Radians, positive with the nose down."""
    yaw_rate: Real = 0.0
    """rad/s, counter-clockwise."""
    position_sigma: Real = 0.0
    """Standard deviation of the position in metres, zero if the driver gives none."""

    @property
    def height(self) -> float:
        """Metres above home."""
        return float(self.position[2])


@fast_pickle
@dataclass(frozen=True, slots=True)
class GpsFix:
    """A global position: WGS84 degrees, metres above the ellipsoid, and its accuracy."""

    latitude: Real
    longitude: Real
    altitude: Real
    horizontal_sigma: Real = 0.0
    """Metres."""
    vertical_sigma: Real = 0.0
    """Metres."""
    satellites: Int64 = 0


@fast_pickle
@dataclass(frozen=True, slots=True)
class Battery:
    """State of the flight battery."""

    fraction: Real
    """Charge left, 0 to 1."""
    voltage: Real = 0.0
    """Volts, zero where unknown."""
    current: Real = 0.0
    """Amperes drawn, zero where unknown."""


Odom = Odometry
"""The paper's name of an odometry sensor's item."""
