"""Rangefinder of a simulated drone: it looks down along the body at the world's surface."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerodaas.clock import NANOSECONDS
from aerodaas.geometry.frames import rotation_from_rpy
from aerodaas.simulation.airframe import RangefinderSettings
from aerodaas.simulation.dynamics import KinematicState
from aerodaas.simulation.scenario import Building
from aerodaas.simulation.world import ROOF_RISE, Thing, World

__all__ = ["SimulatedRangefinder", "Surface"]

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
        """Heights at places of shape (N,) at mission second `time`; NaN where it is not known."""
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
        """Metres straight down to whatever is there at mission time `stamp` in ns.

        None where nothing is within range, and from a tilt of 45 degrees on. Nearer than it can
        measure is as near as it can.
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
