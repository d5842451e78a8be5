"""Frames of reference: local ENU, body FLU, NED/FRD, geodetic, and the pinhole camera.

Positions and velocities in this project are float64 arrays of shape (3,), in metres and m/s, in
the local ENU frame (x east, y north, z up, origin at the environment's home). The body frame is
FLU (x forward, y left, z up). Yaw is in radians, counter-clockwise from east. Drivers convert to
NED, FRD or centimetres once, with the functions below. Angles follow REP 103.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, TypeAlias

import numpy as np
import pymap3d
from numpy.typing import NDArray

from aerodaas.messages.serialization.json_types import XYZ, Int64, Real
from aerodaas.messages.serialization.records import shared_pickle

__all__ = [
    "FLU_FROM_OPTICAL",
    "Box",
    "CameraModel",
    "GeodeticOrigin",
    "Vector",
    "angles_of_rotation",
    "body_to_enu",
    "enu_to_body",
    "enu_to_ned",
    "flu_to_frd",
    "is_close",
    "is_finite",
    "length",
    "ned_to_enu",
    "rotation_from_rpy",
    "wrap_angle",
    "yaw_enu_to_ned",
    "yaw_ned_to_enu",
]

Vector: TypeAlias = Annotated[NDArray[np.float64], XYZ()]
"""A float64 array of shape (3,)."""
Box: TypeAlias = tuple[Real, Real, Real, Real]
"""Left, top, right, bottom in pixels of an image."""
Triple: TypeAlias = tuple[float, float, float]

FLU_FROM_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Takes a camera's optical vectors (x right, y down, z forward) to its own FLU axes."""

_MAJOR = 6378137.0
_MINOR = 6356752.314245179
"""Semi-axes of the WGS84 ellipsoid, metres."""
_ECCENTRICITY_SQUARED = 1.0 - (_MINOR / _MAJOR) ** 2

_RELATIVE, _ABSOLUTE = 1e-5, 1e-8
"""Tolerances of `is_close`: those of `numpy.allclose`."""


def is_finite(vector: Vector) -> bool:
    """Whether all numbers of a vector are finite.

    For three numbers this takes a fifth of the time of `numpy.isfinite`, and the setpoint loop
    asks it a dozen times a turn.
    """
    return all(map(math.isfinite, np.asarray(vector).tolist()))


def length(vector: Vector) -> float:
    """Euclidean norm: the digits of `numpy.linalg.norm`, in a third of its time."""
    return math.sqrt(vector.dot(vector))


def is_close(vector: Vector, other: Vector) -> bool:
    """Whether two finite vectors are equal as `numpy.allclose` has it, in a tenth of its time.

    Args:
        vector: Finite vector.
        other: Another one, of the same length.
    """
    pairs = zip(np.asarray(vector).tolist(), np.asarray(other).tolist(), strict=True)
    return all(abs(one - two) <= _ABSOLUTE + _RELATIVE * abs(two) for one, two in pairs)


def wrap_angle(angle: float) -> float:
    """Wrap an angle in radians to (-pi, pi]."""
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


def enu_to_ned(vector: Vector) -> Vector:
    """(east, north, up) to (north, east, down); the same swap undoes itself."""
    return np.array([vector[1], vector[0], -vector[2]])


def ned_to_enu(vector: Vector) -> Vector:
    """(north, east, down) to (east, north, up)."""
    return enu_to_ned(vector)


def flu_to_frd(vector: Vector) -> Vector:
    """(forward, left, up) to (forward, right, down); the same flip undoes itself."""
    return np.array([vector[0], -vector[1], -vector[2]])


def yaw_enu_to_ned(yaw: float) -> float:
    """Yaw counter-clockwise from east to heading clockwise from north, in (-pi, pi]."""
    return wrap_angle(math.pi / 2 - yaw)


def yaw_ned_to_enu(heading: float) -> float:
    """Heading clockwise from north to yaw counter-clockwise from east, in (-pi, pi]."""
    return wrap_angle(math.pi / 2 - heading)


def body_to_enu(vector: Vector, yaw: float) -> Vector:
    """Turn a level body-frame vector into the ENU frame.

    Args:
        vector: Vector in the level body frame (FLU).
        yaw: Yaw of the body, radians.
    """
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2]])


def enu_to_body(vector: Vector, yaw: float) -> Vector:
    """Turn an ENU vector into the level body frame (FLU).

    Args:
        vector: ENU vector.
        yaw: Yaw of the body, radians.
    """
    return body_to_enu(vector, -yaw)


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> NDArray[np.float64]:
    """Rotation matrix (3, 3) of a body with intrinsic z-y-x angles.

    It takes FLU body vectors to the parent frame.

    Args:
        roll: Radians; positive lowers the right side.
        pitch: Radians; positive turns the nose down.
        yaw: Radians about the vertical, right-handed.
    """
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def angles_of_rotation(
    rotation: NDArray[np.float64], pole: float = 1e-12
) -> tuple[float, float, float]:
    """Roll, pitch and yaw in radians, by which `rotation_from_rpy` gives a rotation.

    Straight up and down roll and yaw are one, and all of it is yaw.

    Args:
        rotation: Rotation matrix, (3, 3).
        pole: Difference of the sine of pitch from one that counts as straight up or down.
    """
    sine = max(-1.0, min(1.0, -float(rotation[2, 0])))
    pitch = math.asin(sine)
    if abs(sine) >= 1.0 - pole:
        return 0.0, pitch, math.atan2(-rotation[0, 1], rotation[1, 1])
    return (
        math.atan2(rotation[2, 1], rotation[2, 2]),
        pitch,
        math.atan2(rotation[1, 0], rotation[0, 0]),
    )


@dataclass(frozen=True)
class GeodeticOrigin:
    """Where the local ENU frame is pinned on the WGS84 ellipsoid: degrees and metres."""

    latitude: float
    longitude: float
    altitude: float = 0.0

    def to_local(self, latitude: float, longitude: float, altitude: float) -> Vector:
        """Convert a geodetic place to local ENU metres.

        Args:
            latitude: Degrees north.
            longitude: Degrees east.
            altitude: Metres above the ellipsoid.
        """
        enu = pymap3d.geodetic2enu(
            latitude, longitude, altitude, self.latitude, self.longitude, self.altitude
        )
        return np.array([float(axis) for axis in enu])

    def to_geodetic(self, position: Vector) -> tuple[float, float, float]:
        """Local ENU metres to latitude and longitude in degrees and altitude in metres.

        Bowring's formulae (Survey Review 23, 1976, and 28, 1985), to a nanometre where drones fly.
        pymap3d takes twenty times as long for a single place, which a simulated drone asks for
        thirty times a second.
        """
        x, y, z = self._to_ecef(*(float(axis) for axis in position))
        across = math.hypot(x, y)
        reduced = math.atan2(z * _MAJOR, across * _MINOR)
        latitude = math.atan2(
            z + (_MAJOR**2 - _MINOR**2) / _MINOR * math.sin(reduced) ** 3,
            across - _ECCENTRICITY_SQUARED * _MAJOR * math.cos(reduced) ** 3,
        )
        sine, cosine = math.sin(latitude), math.cos(latitude)
        level = _MAJOR * math.sqrt(1.0 - _ECCENTRICITY_SQUARED * sine * sine)
        altitude = across * cosine + z * sine - level
        return math.degrees(latitude), math.degrees(math.atan2(y, x)), altitude

    def _to_ecef(self, east: float, north: float, up: float) -> Triple:
        (x, y, z), (sin_lat, cos_lat), (sin_lon, cos_lon) = self._frame
        outwards = cos_lat * up - sin_lat * north
        return (
            x + cos_lon * outwards - sin_lon * east,
            y + sin_lon * outwards + cos_lon * east,
            z + sin_lat * up + cos_lat * north,
        )

    @cached_property
    def _frame(self) -> tuple[Triple, tuple[float, float], tuple[float, float]]:
        """The origin in ECEF metres, and sine and cosine of its latitude and longitude."""
        x, y, z = pymap3d.geodetic2ecef(self.latitude, self.longitude, self.altitude)
        latitude, longitude = math.radians(self.latitude), math.radians(self.longitude)
        return (
            (float(x), float(y), float(z)),
            (math.sin(latitude), math.cos(latitude)),
            (math.sin(longitude), math.cos(longitude)),
        )


@shared_pickle
@dataclass(frozen=True)
class CameraModel:
    """A pinhole camera bolted to a body: intrinsics in pixels, mount in metres and radians.

    The optical frame is x right, y down, z forward. `mount` is the camera's place in the body
    frame (FLU); `pitch` tilts it down when positive, `yaw` turns it left when positive, `roll`
    lowers its right side when positive.
    """

    width: Int64
    height: Int64
    fx: float
    fy: float
    cx: float
    cy: float
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pitch: float = 0.0
    yaw: float = 0.0
    roll: float = 0.0

    @classmethod
    def from_fov(
        cls,
        width: int,
        height: int,
        horizontal_fov: float,
        *,
        mount: tuple[float, float, float] = (0.0, 0.0, 0.0),
        pitch: float = 0.0,
        yaw: float = 0.0,
    ) -> CameraModel:
        """Camera with square pixels and a centred principal point.

        Args:
            width: Pixels.
            height: Pixels.
            horizontal_fov: Horizontal field of view in radians.
            mount: Position in the body, FLU metres.
            pitch: Pitch in the body, radians.
            yaw: Yaw in the body, radians.
        """
        focal = width / 2 / math.tan(horizontal_fov / 2)
        return cls(width, height, focal, focal, width / 2, height / 2, mount, pitch, yaw)

    @property
    def body_from_optical(self) -> NDArray[np.float64]:
        """Rotation (3, 3) that takes optical-frame vectors to the body frame."""
        mounted = rotation_from_rpy(self.roll, self.pitch, self.yaw)
        rotation: NDArray[np.float64] = mounted @ FLU_FROM_OPTICAL
        return rotation

    def ray(self, u: float, v: float) -> Vector:
        """Unit vector in the body frame (FLU) of the ray through a pixel.

        Args:
            u: Pixels from the left.
            v: Pixels from the top.
        """
        optical = np.array([(u - self.cx) / self.fx, (v - self.cy) / self.fy, 1.0])
        body: Vector = self.body_from_optical @ (optical / np.linalg.norm(optical))
        return body

    def project(self, point: Vector) -> tuple[float, float, float]:
        """Project a body-frame point: pixel u, pixel v and depth in metres along the lens axis.

        A depth that is not positive means that the point lies behind the camera; u and v are
        then not a place in the picture.
        """
        x, y, depth = self.body_from_optical.T @ (np.asarray(point) - np.array(self.mount))
        if depth <= 0.0:
            return math.nan, math.nan, float(depth)
        return float(self.fx * x / depth + self.cx), float(self.fy * y / depth + self.cy), depth
