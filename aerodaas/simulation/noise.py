"""Seeded sensor noise of the simulated odometry and GPS."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

import numpy as np

from aerodaas.geometry.frames import GeodeticOrigin, wrap_angle
from aerodaas.messages.odometry import GpsFix, Odometry
from aerodaas.simulation.dynamics import STEP, KinematicState, Triple

__all__ = ["NoiseLevels", "SensorNoise"]


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
        """GPS fix with noise for a true `motion`."""
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
