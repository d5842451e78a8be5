"""Conversion of the autopilot's frames: NED from its own origin to ENU from home, FRD to FLU."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerodaas.geometry.frames import (
    GeodeticOrigin,
    Vector,
    enu_to_ned,
    ned_to_enu,
    yaw_enu_to_ned,
    yaw_ned_to_enu,
)

__all__ = ["Attitude", "LocalFrame", "attitude_from_frd"]


@dataclass(frozen=True, slots=True)
class Attitude:
    """Roll, pitch and yaw in our convention (see `Odometry`), radians and rad/s."""

    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    yaw_rate: float = 0.0


def attitude_from_frd(roll: float, pitch: float, yaw: float, yaw_rate: float) -> Attitude:
    """Convert angles of the FRD body in NED, as in ATTITUDE.

    Args:
        roll: Radians, right side down positive.
        pitch: Radians, nose up positive.
        yaw: Radians clockwise from north.
        yaw_rate: rad/s, clockwise positive.
    """
    return Attitude(roll, -pitch, yaw_ned_to_enu(yaw), -yaw_rate)


@dataclass(frozen=True, slots=True, eq=False)
class LocalFrame:
    """Position of the autopilot's local NED origin in our frame, ENU metres."""

    origin: Vector

    @classmethod
    def standing_at(cls, start: Vector, ned: Vector) -> LocalFrame:
        """Align the frame so that the position `ned` is our `start`.

        Args:
            start: ENU metres in our frame.
            ned: The same place in the autopilot's frame, NED metres.
        """
        return cls(start - ned_to_enu(ned))

    @classmethod
    def over_home(
        cls, home: GeodeticOrigin, latitude: float, longitude: float, up: float, ned: Vector
    ) -> LocalFrame:
        """Align it by the global position of the position `ned`.

        Heights are not taken from the global position: an autopilot's is above mean sea level, ours
        is above the ellipsoid, and the two differ by up to a hundred metres.

        Args:
            home: Geodetic origin of our frame.
            latitude: Degrees.
            longitude: Degrees.
            up: Height of the position above home, metres.
            ned: In the autopilot's frame, NED metres.
        """
        east, north, _ = home.to_local(latitude, longitude, home.altitude)
        return cls.standing_at(np.array([east, north, up]), ned)

    def position(self, ned: Vector) -> Vector:
        """Convert a position of the autopilot to ENU."""
        return ned_to_enu(ned) + self.origin

    def place(self, enu: Vector) -> Vector:
        """Convert our position to the autopilot's NED."""
        return enu_to_ned(enu - self.origin)

    @staticmethod
    def velocity(vector: Vector) -> Vector:
        """Convert a velocity from the autopilot's frame to ours, or back: origins do not matter."""
        return ned_to_enu(vector)

    @staticmethod
    def heading(yaw: float) -> float:
        """Convert our yaw to a heading, clockwise from north."""
        return yaw_enu_to_ned(yaw)
