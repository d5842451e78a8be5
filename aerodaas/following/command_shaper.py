"""Velocity commands within limits of speed, then of acceleration, from one frame to the next."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerodaas.following.follow_settings import FollowLimits
from aerodaas.types.waypoints import VelocityCommand

__all__ = ["CommandShaper"]


class CommandShaper:
    """Remembers the last command, so that the next one differs from it by no more than it may."""

    def __init__(self, limits: FollowLimits) -> None:
        """Start at rest."""
        self.limits = limits
        self._velocity: NDArray[np.float64] = np.zeros(3)
        self._yaw_rate = 0.0

    def reset(self) -> None:
        """Be at rest again."""
        self._velocity, self._yaw_rate = np.zeros(3), 0.0

    def towards(self, bearing: float) -> float:
        """The last command's speed in m/s in a direction of the body, positive to the left."""
        return float(self._velocity[:2] @ (np.cos(bearing), np.sin(bearing)))

    def shape(
        self,
        wanted: NDArray[np.float64],
        yaw_rate: float,
        dt: float,
        priority: int,
        *,
        braking: bool = False,
    ) -> VelocityCommand:
        """Command for `wanted` (forward, left, up in m/s) and `yaw_rate` (rad/s).

        `dt` is the time since the last command in seconds; `braking` lets the velocity change
        as fast as the limits say for that. Numbers that are not finite command a stop, at once.
        """
        limits = self.limits
        if not np.isfinite([*wanted, yaw_rate]).all():
            self.reset()
            return VelocityCommand(priority=priority)
        flat, climb = wanted[:2], _clip(float(wanted[2]), limits.climb)
        speed = float(np.hypot(*flat))
        fastest = limits.forward if flat[0] >= 0 else limits.backward
        if speed > fastest:
            flat = flat * fastest / speed
        change = np.array([*flat, climb]) - self._velocity
        largest = (limits.stopping if braking else limits.acceleration) * dt
        if (size := float(np.linalg.norm(change))) > largest:
            change = change * largest / size
        turn = _clip(yaw_rate, limits.yaw_rate) - self._yaw_rate
        self._velocity = self._velocity + change
        self._yaw_rate += _clip(turn, limits.yaw_acceleration * dt)
        forward, left, up = self._velocity.tolist()
        return VelocityCommand(forward, left, up, self._yaw_rate, priority=priority)


def _clip(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
