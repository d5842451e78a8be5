"""The autopilot's frames and ours: NED from its own origin to ENU from home, FRD to FLU."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerodaas.types.geometry import (
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
    """Roll, pitch and yaw in our own sense (see `Odometry`), radians and rad/s."""

    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    yaw_rate: float = 0.0


def attitude_from_frd(roll: float, pitch: float, yaw: float, yaw_rate: float) -> Attitude:
    """Angles of the FRD body in NED, as ATTITUDE has them: nose up and clockwise positive."""
    return Attitude(roll, -pitch, yaw_ned_to_enu(yaw), -yaw_rate)


@dataclass(frozen=True, slots=True, eq=False)
class LocalFrame:
    """Where the origin of the autopilot's local NED frame lies in ours, ENU metres."""

    origin: Vector

    @classmethod
    def standing_at(cls, start: Vector, ned: Vector) -> LocalFrame:
        """Pin the frame so that the place `ned` is `start` of ours."""
        return cls(start - ned_to_enu(ned))

    @classmethod
    def over_home(
        cls, home: GeodeticOrigin, latitude: float, longitude: float, up: float, ned: Vector
    ) -> LocalFrame:
        """Pin it by the global position of the place `ned`, which is `up` metres above home.

        Heights are not taken from the global position: an autopilot's is above mean sea level,
        ours is above the ellipsoid, and the two differ by up to a hundred metres.
        """
        east, north, _ = home.to_local(latitude, longitude, home.altitude)
        return cls.standing_at(np.array([east, north, up]), ned)

    def position(self, ned: Vector) -> Vector:
        """A place of the autopilot's in ENU."""
        return ned_to_enu(ned) + self.origin

    def place(self, enu: Vector) -> Vector:
        """A place of ours in the autopilot's NED."""
        return enu_to_ned(enu - self.origin)

    @staticmethod
    def velocity(vector: Vector) -> Vector:
        """A velocity from the autopilot's frame to ours, or back: the origins do not matter."""
        return ned_to_enu(vector)

    @staticmethod
    def heading(yaw: float) -> float:
        """Our yaw as a heading, clockwise from north."""
        return yaw_enu_to_ned(yaw)
