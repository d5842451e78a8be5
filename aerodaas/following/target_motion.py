"""Constant-velocity Kalman filter of the target's position and velocity on the ground.

It works in the local ENU frame, so that the drone's own motion is not mistaken for the target's,
and compensates the latency from a frame's capture to the resulting command.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from aerodaas.clock import seconds
from aerodaas.following.relative_target import RelativeTarget
from aerodaas.messages.odometry import Odometry

__all__ = ["TargetMotion", "place_of", "seen_from"]

_RANGE_NOISE, _SIDE_NOISE = 0.06, 0.02
"""Standard deviations along and across the line of sight, as fractions of the distance."""
_LEAST_NOISE = 0.03
_ACCELERATION = 0.7
"""Standard deviation of a walking person's acceleration, m/s^2."""
_LEAP, _PATIENCE = 2.5, 0.5
"""Gate of a sighting in standard deviations of range, and seconds for which it is applied."""
_NEAREST = 0.1
_FIRST_SPEED = 0.7
"""Standard deviation of a velocity not yet observed, m/s."""


def seen_from(odometry: Odometry, place: tuple[float, float]) -> RelativeTarget:
    """Bearing and distance of a place (metres east, north of home) from a drone at `odometry`."""
    way = np.array(place) - odometry.position[:2]
    bearing = math.remainder(math.atan2(way[1], way[0]) - odometry.yaw, math.tau)
    return RelativeTarget(bearing, float(np.hypot(*way)))


def place_of(sighting: RelativeTarget, odometry: Odometry) -> NDArray[np.float64]:
    """Position (2,) of a sighting from a drone at `odometry`, metres east and north of home."""
    heading = odometry.yaw + sighting.bearing
    towards = np.array([math.cos(heading), math.sin(heading)])
    return np.asarray(odometry.position[:2] + sighting.distance * towards)


class TargetMotion:
    """Estimator of the target's position and velocity, east and north."""

    def __init__(self, acceleration: float = _ACCELERATION, speed: float = _FIRST_SPEED) -> None:
        """Set the standard deviations of the target's acceleration (m/s²) and initial speed (m/s).

        With both zero, the target is assumed to be static.
        """
        self.acceleration = acceleration
        """Standard deviation of the target's acceleration, m/s²."""
        self._speed = speed
        self._state: NDArray[np.float64] | None = None
        self._covariance: NDArray[np.float64] = np.zeros((4, 4))
        self._stamp = 0

    @property
    def known(self) -> bool:
        """Whether the target was observed since the last reset."""
        return self._state is not None

    @property
    def place(self) -> tuple[float, float] | None:
        """Last estimated position, metres east and north of home; None before the first."""
        return None if self._state is None else (float(self._state[0]), float(self._state[1]))

    def reset(self) -> None:
        """Discard the estimate."""
        self._state = None

    def leaps(self, sighting: RelativeTarget, odometry: Odometry, stamp: int) -> bool:
        """Whether a sighting is farther away than the target can have moved.

        Such a box shows a part of the target, or a person about to fall. It is accepted if it
        persists.
        """
        predicted = self.relative_to(odometry, stamp)
        if predicted is None or seconds(stamp - self._stamp) > _PATIENCE:
            return False
        return sighting.distance - predicted[0].distance > _LEAP * _RANGE_NOISE * sighting.distance

    def observe(self, sighting: RelativeTarget, odometry: Odometry, stamp: int) -> None:
        """Update the estimate by a sighting at `stamp` from a drone at `odometry`."""
        heading = odometry.yaw + sighting.bearing
        along = np.array([math.cos(heading), math.sin(heading)])
        across = np.array([-along[1], along[0]])
        place = place_of(sighting, odometry)
        range_sigma = max(_LEAST_NOISE, _RANGE_NOISE * sighting.distance)
        side_sigma = max(_LEAST_NOISE, _SIDE_NOISE * sighting.distance)
        noise = range_sigma**2 * np.outer(along, along) + side_sigma**2 * np.outer(across, across)
        if self._state is None:
            self._state = np.array([*place, 0.0, 0.0])
            self._covariance = np.zeros((4, 4))
            self._covariance[:2, :2] = noise
            self._covariance[2:, 2:] = self._speed**2 * np.eye(2)
        else:
            state, covariance = self._predicted(self._state, seconds(stamp - self._stamp))
            gain = covariance[:, :2] @ np.linalg.inv(covariance[:2, :2] + noise)
            self._state = state + gain @ (place - state[:2])
            self._covariance = covariance - gain @ covariance[:2]
        self._stamp = stamp

    def relative_to(
        self, odometry: Odometry, stamp: int
    ) -> tuple[RelativeTarget, float, float] | None:
        """Predict the target at `stamp` relative to a drone at `odometry`.

        Returns the bearing and distance, and the target's velocity in m/s away from the drone
        along the line of sight and to the left across it. None before the first observation.
        """
        if self._state is None:
            return None
        velocity = self._state[2:]
        place = self._state[:2] + velocity * seconds(stamp - self._stamp)
        found = seen_from(odometry, (float(place[0]), float(place[1])))
        along = (place - odometry.position[:2]) / max(found.distance, _NEAREST)
        away = float(velocity @ along)
        left = float(along[0] * velocity[1] - along[1] * velocity[0])
        return found, away, left

    def spread(self, stamp: int) -> float:
        """Standard deviation of the position predicted for `stamp`, metres; 0 without a target."""
        if self._state is None:
            return 0.0
        _, covariance = self._predicted(self._state, seconds(stamp - self._stamp))
        return float(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1]))

    def _predicted(
        self, state: NDArray[np.float64], dt: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """State and covariance `dt` seconds later."""
        step = np.eye(4)
        step[0, 2] = step[1, 3] = dt
        push = np.vstack([np.eye(2) * dt**2 / 2, np.eye(2) * dt])
        covariance = step @ self._covariance @ step.T + self.acceleration**2 * push @ push.T
        return step @ state, covariance
