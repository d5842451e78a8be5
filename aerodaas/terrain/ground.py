"""The ground beneath a flight, in its local frame.

A terrain model may lie metres too high or too low, and above another sea level than the vehicle's.
The vehicle stands on the ground where it takes off; heights are differences from there, so that
such an error cancels out, as in ArduPilot (`TERRAIN_OFS_MAX`).
"""

from __future__ import annotations

import math

import numpy as np
import pymap3d
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from aerodaas.config.model import EnvironmentConfig, RobotConfig, TerrainConfig
from aerodaas.errors import ConfigError
from aerodaas.geometry.frames import GeodeticOrigin, Vector
from aerodaas.terrain.terrain import Terrain

__all__ = ["Ground", "agreed_sea_level"]

_MAJOR, _ECCENTRICITY_SQUARED = 6378137.0, 6.69437999014e-3
"""WGS84: semi-major axis in metres, first eccentricity squared."""
_AROUND = 200.0
"""Metres of ground beyond the range of the flight that are kept in memory."""
_TOLERANCE = 30.0
"""Metres by which terrain, vehicle and file may differ on the height of home, as ArduPilot's
TERRAIN_OFS_MAX: the geoid lies up to a hundred metres from the ellipsoid."""


def agreed_sea_level(given: float | None, told: float | None) -> float | None:
    """Metres of home above the sea: as an environment file gives them, else as the vehicle does.

    Raises ConfigError if they contradict each other.
    """
    if given is not None and told is not None and abs(given - told) > _TOLERANCE:
        raise ConfigError(
            f"home lies {given:.0f} m above the sea by the environment file, and {told:.0f} m by "
            "the vehicle: is home.above_sea above the ellipsoid?"
        )
    return told if given is None else given


class Ground:
    """Heights of the ground around a place of take-off, in local ENU metres.

    All are metres above the local frame's zero, as the vehicle's own height, along the level of
    the sea and not along the tangent plane.
    """

    def __init__(
        self, terrain: Terrain, origin: GeodeticOrigin, takeoff: Vector, reach: float
    ) -> None:
        """Read the ground within `reach` metres of `takeoff` (ENU metres), where a drone stands.

        Raises ConfigError if the ground there is not known.
        """
        self._terrain = terrain
        self._pin(origin)
        self._centre = takeoff[:2].astype(np.float64)
        self._reach = reach + _AROUND
        corners = self._centre + self._reach * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
        latitudes, longitudes = self._degrees(corners[:, 0], corners[:, 1])
        self._patch = terrain.patch(
            float(latitudes.min()),
            float(longitudes.min()),
            float(latitudes.max()),
            float(longitudes.max()),
        )
        self._zero = 0.0
        at_takeoff = self.height(float(takeoff[0]), float(takeoff[1]))
        if math.isnan(at_takeoff):
            raise ConfigError(f"at the take-off, {self.why_unknown(*takeoff[:2])}")
        self._zero = at_takeoff - float(takeoff[2])

    @classmethod
    def around(cls, robot: RobotConfig, environment: EnvironmentConfig) -> Ground | None:
        """The ground around the start of a simulated robot; None for a flat one.

        Args:
            robot: The robot, which stands on it.
            environment: Its home and terrain.

        Raises:
            ConfigError: For a terrain that cannot be read.
        """
        home, terrain = environment.home, environment.terrain
        if home is None or terrain is None:
            return None
        return cls.of(terrain, home.origin, np.array(robot.start), robot.limits.max_range)

    def _pin(self, origin: GeodeticOrigin) -> None:
        """Prepare the conversion to degrees around `origin`."""
        self._origin = origin
        latitude = math.radians(origin.latitude)
        sine, cosine, tangent = math.sin(latitude), math.cos(latitude), math.tan(latitude)
        root = 1.0 - _ECCENTRICITY_SQUARED * sine * sine
        meridian = _MAJOR * (1.0 - _ECCENTRICITY_SQUARED) / root**1.5 + origin.altitude
        normal = _MAJOR / math.sqrt(root) + origin.altitude
        self._metres_north = math.radians(1.0) * meridian
        self._metres_east = math.radians(1.0) * normal * cosine
        self._bend_north = tangent / (2.0 * normal)
        self._bend_east = tangent / meridian

    @classmethod
    def of(
        cls,
        config: TerrainConfig,
        origin: GeodeticOrigin,
        takeoff: Vector,
        reach: float,
        sea_level: float | None = None,
    ) -> Ground:
        """Read the ground of an environment's terrain.

        Raises ConfigError as `Terrain.open` does, if the ground at the take-off is not known, and
        if its height above the sea contradicts `sea_level`, that of the local frame's zero.
        """
        ground = cls(Terrain.open(config.files), origin, takeoff, reach)
        if sea_level is not None and abs(sea_level - ground.sea_level) > _TOLERANCE:
            raise ConfigError(
                f"home lies {sea_level:.0f} m above the sea by its own word, and "
                f"{ground.sea_level:.0f} m by the terrain: one is wrong, or above the ellipsoid"
            )
        return ground

    @property
    def sea_level(self) -> float:
        """Metres above mean sea level of the local frame's zero, by the terrain."""
        return self._zero

    @property
    def spacing(self) -> float:
        """Metres between the terrain's samples, the smaller of both directions."""
        grid = self._patch.grid
        steps = (grid.latitude_step * self._metres_north, grid.longitude_step * self._metres_east)
        return float(min(steps))

    def heights(self, east: NDArray[np.float64], north: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights of the ground at places of any shape; NaN where it is not known."""
        return self._patch.heights(*self._degrees(east, north)) - self._zero

    def height(self, east: float, north: float) -> float:
        """Height of the ground at a place; NaN where it is not known."""
        return float(self.heights(np.array([east]), np.array([north]))[0])

    def why_unknown(self, east: float, north: float) -> str:
        """Say why the ground at a place is not known."""
        latitudes, longitudes = self._degrees(np.array([east]), np.array([north]))
        return self._terrain.why_unknown(float(latitudes[0]), float(longitudes[0]))

    def along(self, start: Vector, end: Vector) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Distances from `start` on the level way to `end`, and the ground's heights there.

        Both have the shape (N,), begin at `start`, end at `end`, and are at most half a spacing
        apart.
        """
        way = np.asarray(end[:2]) - np.asarray(start[:2])
        long = math.hypot(*way)
        count = 2 + math.ceil(long / (0.5 * self.spacing))
        shares = np.linspace(0.0, 1.0, count)
        return shares * long, self.heights(start[0] + shares * way[0], start[1] + shares * way[1])

    def unknown(self) -> BaseGeometry | None:
        """Where the ground is not known, as polygons (east, north); None if it is everywhere."""
        grid, void = self._patch.grid, np.isnan(self._patch.samples)
        cells = void[:-1, :-1] | void[:-1, 1:] | void[1:, :-1] | void[1:, 1:]
        if not cells.any():
            return None
        # Runs of cells, row by row: an area without data has a few hundred of them, not millions.
        padded = np.pad(cells, ((0, 0), (1, 1))).astype(np.int8)
        rows, starts = np.nonzero(np.diff(padded, axis=1) == 1)
        _, ends = np.nonzero(np.diff(padded, axis=1) == -1)
        north = grid.north - np.stack([rows, rows, rows + 1, rows + 1], 1) * grid.latitude_step
        east = grid.west + np.stack([starts, ends, ends, starts], 1) * grid.longitude_step
        origin = self._origin
        x, y, _ = pymap3d.geodetic2enu(
            north, east, origin.altitude, origin.latitude, origin.longitude, origin.altitude
        )
        seam = 0.1
        return shapely.union_all(shapely.polygons(np.stack([x, y], 2))).buffer(seam)

    def _degrees(
        self, east: NDArray[np.float64], north: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Latitudes and longitudes, to the second order: 0.3 m at 10 km and 60 degrees north."""
        latitudes = (
            self._origin.latitude + (north - self._bend_north * east * east) / self._metres_north
        )
        longitudes = self._origin.longitude + (
            east * (1.0 + self._bend_east * north) / self._metres_east
        )
        return latitudes, longitudes
