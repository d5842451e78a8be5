"""Clearance above the ground: what it allows of a velocity, and how high a target must lie.

As long as the ground and the clearance lie below the drone all along its braking distance, it can
stop in time: towards higher ground its speed is bounded by the distance to it, downwards by the
height over the highest of it, and where a command leads to higher ground, the drone climbs. It is
slowed down, not turned aside: who flies along a slope wants to.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from aerodaas.config.model import EnvironmentConfig, LimitsConfig
from aerodaas.geometry.braking import braking_speed
from aerodaas.geometry.frames import Vector, wrap_angle
from aerodaas.terrain.ground import Ground

__all__ = ["GroundClearance", "GroundView", "climb_speed"]

_RAYS = 5
"""Directions in which the ground is looked at, from that of the command to that of the flight."""
_STILL = 0.2
"""m/s below which a drone flies in no direction."""
_FEWEST, _MOST = 24, 96
"""Samples a ray."""
_ABOVE = 0.2
"""Metres over what is needed to which the drone climbs, so that it does not creep up to it."""
_ROUNDING = 1e-6


class GroundClearance:
    """The ground around one drone and the height that it needs above it."""

    def __init__(self, ground: Ground, clearance: float, limits: LimitsConfig) -> None:
        """Keep `clearance` metres above `ground`, flying within `limits`."""
        self.ground = ground
        self.clearance = clearance
        self.unknown = ground.unknown()
        """Where the ground is not known: no drone flies there."""
        self._limits = limits
        reach = float(self._stop(limits.max_speed))
        count = min(max(math.ceil(reach / (0.5 * ground.spacing)), _FEWEST), _MOST)
        self._distances = np.linspace(0.0, reach + reach / count, count + 2)

    @classmethod
    def of(
        cls,
        environment: EnvironmentConfig,
        limits: LimitsConfig,
        takeoff: Vector,
        sea_level: float | None,
    ) -> GroundClearance | None:
        """That of a drone which stands at `takeoff`; None without a terrain.

        Args:
            environment: Home and terrain.
            limits: Of the drone; `max_range` bounds the ground that is read.
            takeoff: Where the drone stands, ENU metres.
            sea_level: Height of the local frame's zero above the sea, metres; None if not known.

        Raises:
            ConfigError: As `Ground.of`.
        """
        home, terrain = environment.home, environment.terrain
        if home is None or terrain is None:
            return None
        origin = home.origin
        ground = Ground.of(terrain, origin, takeoff, limits.max_range, sea_level)
        return cls(ground, terrain.clearance, limits)

    def needed(self, east: float, north: float) -> float:
        """The lowest height to fly at over a place, metres; NaN over unknown ground.

        Args:
            east: Metres in the local frame.
            north: Metres in the local frame.
        """
        return self.ground.height(east, north) + self.clearance

    def raised(self, target: Vector) -> Vector:
        """`target`, no lower than what is needed there."""
        needed = self.needed(float(target[0]), float(target[1]))
        return np.array([target[0], target[1], needed]) if needed > target[2] else target

    def objection(self, position: Vector) -> str:
        """Return why a target is too near to the ground, or an empty string."""
        above = float(position[2]) - self.ground.height(float(position[0]), float(position[1]))
        if above >= self.clearance - _ROUNDING:
            return ""
        if math.isnan(above):
            return self.ground.why_unknown(float(position[0]), float(position[1]))
        return f"{above:.1f} m above the ground is less than terrain.clearance {self.clearance:g} m"

    def view(self, position: Vector, velocity: Vector, asked: Vector) -> GroundView:
        """Look at the ground around `position`.

        Args:
            position: Where the drone is, ENU metres.
            velocity: As measured, ENU m/s.
            asked: As requested, ENU m/s.
        """
        rays = _rays(velocity, asked)
        east = position[0] + rays[:, :1] * self._distances
        north = position[1] + rays[:, 1:] * self._distances
        needed = self.ground.heights(east, north) + self.clearance
        step = float(self._distances[1])
        speeds = np.maximum(np.maximum(rays @ velocity[:2], rays @ asked[:2]), 0.0)
        stops = np.asarray(self._stop(speeds)) + 1.5 * step
        covered = self._distances <= stops[:, None]
        return GroundView(float(position[2]), rays, self._distances, needed, covered, self._limits)

    def _stop(self, speed: NDArray[np.float64] | float) -> NDArray[np.float64] | float:
        """Metres until a drone stands, and those that it flies on before it brakes."""
        limits = self._limits
        return speed * (2 * limits.reaction_time + speed / (2 * limits.max_acceleration))


class GroundView:
    """Demands of the ground around a drone at one moment."""

    def __init__(
        self,
        height: float,
        rays: NDArray[np.float64],
        distances: NDArray[np.float64],
        needed: NDArray[np.float64],
        covered: NDArray[np.bool_],
        limits: LimitsConfig,
    ) -> None:
        """Judge the heights `needed` at `distances` along `rays`, the first of them the command's.

        `covered` are those within the braking distance.
        """
        self._height = height
        self._rays = rays
        self._distances = distances
        self._needed = needed
        self._covered = covered
        self._limits = limits

    def walls(self) -> Iterator[tuple[Vector, float]]:
        """Level unit vectors towards ground that is too high, and the room in metres before it.

        Ground no higher than that beneath a drone which is too low already is no wall: there it
        climbs.
        """
        # Unknown ground is nothing here: the geofence leaves it out.
        here = float(self._needed[0, 0])
        level = self._height if math.isnan(here) else max(self._height, here)
        high = self._needed > level + _ROUNDING
        for ray in np.flatnonzero(high.any(axis=1)):
            first = int(high[ray].argmax())
            way = np.array([*self._rays[ray], 0.0])
            yield way, float(self._distances[max(first - 1, 0)])

    def room_below(self) -> float:
        """Metres that the drone may descend; none where it may pass over unknown ground."""
        beneath = self._needed[self._covered]
        return 0.0 if np.isnan(beneath).any() else self._height - float(beneath.max())

    def climb(self) -> float:
        """Speed at which the drone must climb, m/s; minus infinity if it need not."""
        ahead = self._needed[0][self._covered[0]]
        missing = float(np.nanmax(ahead, initial=-math.inf)) - self._height
        return -math.inf if missing <= _ROUNDING else climb_speed(missing, self._limits)


def climb_speed(missing: float, limits: LimitsConfig) -> float:
    """Speed at which a drone climbs that flies too low, m/s.

    Args:
        missing: Height that it lacks, metres.
        limits: Climb speed, acceleration and reaction time of the drone.
    """
    speed = braking_speed(missing + _ABOVE, limits.max_acceleration, limits.reaction_time)
    return min(limits.max_climb, speed)


def _rays(velocity: Vector, asked: Vector) -> NDArray[np.float64]:
    """Level unit vectors from the direction asked for to that of the flight, shape (N, 2)."""
    flies = math.hypot(velocity[0], velocity[1]) > _STILL
    last = math.atan2(velocity[1], velocity[0])
    first = math.atan2(asked[1], asked[0]) if asked[:2].any() else last
    turn = wrap_angle(last - first) if flies else 0.0
    angles = first + np.linspace(0.0, turn, _RAYS if turn else 1)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)
