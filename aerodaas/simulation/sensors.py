"""Sensors of a simulated drone: seeded noise of odometry and GPS, and the rangefinder below."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerodaas.clock import NANOSECONDS
from aerodaas.geometry.frames import GeodeticOrigin, rotation_from_rpy, wrap_angle
from aerodaas.messages.odometry import GpsFix, Odometry
from aerodaas.simulation.airframe import RangefinderSettings
from aerodaas.simulation.dynamics import STEP, KinematicState, Triple
from aerodaas.simulation.scenario import Building
from aerodaas.simulation.world import ROOF_RISE, Thing, World

__all__ = ["NoiseLevels", "SensorNoise", "SimulatedRangefinder", "Surface"]


@dataclass(frozen=True, slots=True)
class NoiseLevels:
    """Standard deviations at a scale of 1, of a good outdoor filter with GNSS and vision."""

    position: float = 0.01
    """White noise, metres."""
    drift: float = 0.08
    """Slow drift, metres per horizontal axis."""
    drift_vertical: float = 0.03
    """Slow drift, metres, with a downward rangefinder."""
    drift_time: float = 60.0
    """Correlation time of the drifts, seconds."""
    velocity: float = 0.03
    """White noise, m/s."""
    angle: float = 0.003
    """White noise of roll, pitch and yaw, radians."""
    yaw_drift: float = 0.01
    """Slow drift, radians."""
    gps: float = 0.6
    """Slow error, metres per horizontal axis."""
    gps_vertical: float = 1.0
    """Slow error, metres."""
    satellites: int = 14


class SensorNoise:
    """Errors of odometry and GPS, updated every `PERIOD` steps of the flight dynamics.

    A scale of 0 returns the true values. Drifts are Ornstein-Uhlenbeck processes; the odometry's
    start at zero, because a filter is aligned at the start.
    """

    PERIOD = 5
    """Steps of the dynamics between updates: 20 Hz."""

    def __init__(self, scale: float, seed: str, levels: NoiseLevels | None = None) -> None:
        """Scale all levels by `scale`."""
        self._scale = scale
        self._levels = levels or NoiseLevels()
        self._draw = random.Random(seed).gauss
        self._keep = math.exp(-STEP * self.PERIOD / self._levels.drift_time)
        self._stir = math.sqrt(1.0 - self._keep**2)
        self.drift: Triple = (0.0, 0.0, 0.0)
        """Slow error of the estimated position in metres, which the controller cannot correct."""
        self.yaw_drift = 0.0
        """Slow error of the estimated yaw, radians."""
        self._gps = self._white(self._levels.gps, self._levels.gps, self._levels.gps_vertical)
        self._position = self._velocity = self._angles = (0.0, 0.0, 0.0)

    def _white(self, x: float, y: float, z: float) -> Triple:
        if self._scale <= 0.0:
            return 0.0, 0.0, 0.0
        draw, scale = self._draw, self._scale
        return draw(0.0, x * scale), draw(0.0, y * scale), draw(0.0, z * scale)

    def _wander(self, now: Triple, x: float, y: float, z: float) -> Triple:
        kick, keep, stir = self._white(x, y, z), self._keep, self._stir
        return (
            keep * now[0] + stir * kick[0],
            keep * now[1] + stir * kick[1],
            keep * now[2] + stir * kick[2],
        )

    def update(self) -> None:
        """Advance by `PERIOD` steps."""
        if self._scale <= 0.0:
            return
        levels = self._levels
        self.drift = self._wander(self.drift, levels.drift, levels.drift, levels.drift_vertical)
        self.yaw_drift, _, _ = self._wander((self.yaw_drift, 0.0, 0.0), levels.yaw_drift, 0.0, 0.0)
        self._gps = self._wander(self._gps, levels.gps, levels.gps, levels.gps_vertical)
        self._position = self._white(levels.position, levels.position, levels.position)
        self._velocity = self._white(levels.velocity, levels.velocity, levels.velocity)
        self._angles = self._white(levels.angle, levels.angle, levels.angle)

    def odometry(self, motion: KinematicState) -> Odometry:
        """Odometry with noise for a true `motion`."""
        levels, angles = self._levels, self._angles
        return Odometry(
            np.array(motion.position) + self.drift + self._position,
            np.array(motion.velocity) + self._velocity,
            wrap_angle(motion.yaw + self.yaw_drift + angles[2]),
            motion.roll + angles[0],
            motion.pitch + angles[1],
            motion.yaw_rate,
            self._scale * math.hypot(levels.drift, levels.position),
        )

    def gps(self, motion: KinematicState, origin: GeodeticOrigin) -> GpsFix:
        """GPS fix with noise.

        Args:
            motion: The true motion.
            origin: Geodetic origin of the local frame.
        """
        levels = self._levels
        latitude, longitude, altitude = origin.to_geodetic(np.array(motion.position) + self._gps)
        return GpsFix(
            latitude,
            longitude,
            altitude,
            self._scale * levels.gps,
            self._scale * levels.gps_vertical,
            levels.satellites,
        )


Floats = NDArray[np.float64]
Heights = Callable[[Floats, Floats], Floats]
"""Height of the ground at places east and north, local metres; NaN where it is not known."""

_LEVEL = math.radians(45)
"""Tilt from which on it looks at something else than what is below, as on MAVLink."""
_SAMPLES = 240
"""Places along the beam at which the surface is asked for."""
_RATE = 10
"""Readings a second, each with an error of its own."""


class _Top(NamedTuple):
    """The upper side of one box: place, direction, extents, height, and the fall from a ridge."""

    x: float
    y: float
    cosine: float
    sine: float
    half_length: float
    half_width: float
    height: float
    slope: float
    """Metres down for each metre across from the ridge; 0 for a level top."""


class Surface:
    """Heights of the highest thing at a place: ground, roofs; trees, cars, … by their boxes."""

    def __init__(self, world: World, level: float, ground: Heights | None = None) -> None:
        """Have level ground at `level`, or `ground` that has this height where the drone starts.

        Things stand on the plane z = 0, as they are drawn, and rise and fall with the ground.
        """
        self._level = level
        self._ground = ground
        self._moving = [thing for thing in world.things if thing.moves]
        still = (thing for thing in world.things if not thing.moves)
        self._still = [top for thing in still for top in _tops(thing, 0.0)]

    def heights(self, east: Floats, north: Floats, time: float) -> Floats:
        """Heights of what is seen from above, metres; NaN where the ground is not known.

        Args:
            east: Metres in the local frame, (N,).
            north: Metres in the local frame, (N,).
            time: Mission time, seconds.
        """
        tops = np.full(len(east), self._level)
        moving = (top for thing in self._moving for top in _tops(thing, time))
        for top in (*self._still, *moving):
            reach = top.half_length + top.half_width
            if (np.abs(east - top.x) > reach).all() or (np.abs(north - top.y) > reach).all():
                continue
            along = top.cosine * (east - top.x) + top.sine * (north - top.y)
            across = np.abs(top.cosine * (north - top.y) - top.sine * (east - top.x))
            inside = (np.abs(along) <= top.half_length) & (across <= top.half_width)
            height = top.height - top.slope * across
            tops = np.where(inside, np.maximum(tops, height), tops)
        return tops if self._ground is None else tops + self._ground(east, north) - self._level


class SimulatedRangefinder:
    """Measures as a small lidar does; the same seed and moment, the same error."""

    def __init__(
        self, settings: RangefinderSettings, surface: Surface, noise: float, seed: str
    ) -> None:
        """Scale its noise by `noise`."""
        self._settings = settings
        self._surface = surface
        self._noise = noise
        self._seed = seed

    def below(self, motion: KinematicState, stamp: int) -> float | None:
        """Metres straight down to whatever is there.

        Nearer than it can measure is as near as it can.

        Args:
            motion: The true motion.
            stamp: Mission clock, nanoseconds.

        Returns:
            None where nothing is within range, and from a tilt of 45 degrees on.
        """
        down = -rotation_from_rpy(motion.roll, motion.pitch, motion.yaw)[:, 2]
        upright = -float(down[2])
        if upright < math.cos(_LEVEL):
            return None
        settings = self._settings
        far = np.linspace(0.0, settings.max_range, _SAMPLES + 1)
        east, north, up = (
            here + way * far for here, way in zip(motion.position, down, strict=True)
        )
        over = up - self._surface.heights(east, north, stamp / NANOSECONDS)
        hits = np.flatnonzero(over <= 0.0)
        if not len(hits):
            return None
        read = self._distance(far, over, int(hits[0])) + self._error(stamp)
        if read > settings.max_range:
            return None
        return max(read, settings.min_range) * upright

    @staticmethod
    def _distance(far: Floats, over: Floats, hit: int) -> float:
        """Where the beam meets the surface, between two samples; at once for one below it."""
        if hit == 0:
            return 0.0
        before, after = float(over[hit - 1]), float(over[hit])
        if math.isnan(before):
            return float(far[hit])
        return float(far[hit - 1] + (far[hit] - far[hit - 1]) * before / (before - after))

    def _error(self, stamp: int) -> float:
        sigma = self._noise * self._settings.noise
        slot = stamp * _RATE // NANOSECONDS
        return random.Random(f"{self._seed}/{slot}").gauss(0.0, sigma) if sigma > 0.0 else 0.0


def _tops(thing: Thing, time: float) -> Iterable[_Top]:
    spec = thing.spec
    slope = ROOF_RISE if isinstance(spec, Building) and spec.roof == "gable" else 0.0
    for box in thing.boxes(time):
        (x, y, middle), (length, width, height) = box.centre, box.size
        yield _Top(
            *(x, y, math.cos(box.yaw), math.sin(box.yaw)),
            *(length / 2, width / 2, middle + height / 2, slope),
        )
