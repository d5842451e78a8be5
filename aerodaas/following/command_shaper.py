"""Speed and acceleration limits of velocity commands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerodaas.following.follow_settings import FollowLimits
from aerodaas.messages.waypoints import VelocityCommand

__all__ = ["CommandShaper"]


class CommandShaper:
    """Rate limiter: limits a command's speed, then its difference to the previous command."""

    def __init__(self, limits: FollowLimits) -> None:
        """Start with a zero command."""
        self.limits = limits
        self._velocity: NDArray[np.float64] = np.zeros(3)
        self._yaw_rate = 0.0

    def reset(self) -> None:
        """Return to a zero command."""
        self._velocity, self._yaw_rate = np.zeros(3), 0.0

    def towards(self, bearing: float) -> float:
        """Speed of the last command in m/s towards a body-frame bearing, positive to the left."""
        return float(self._velocity[:2] @ (np.cos(bearing), np.sin(bearing)))

    def shape(
        self,
        wanted: NDArray[np.float64],
        yaw_rate: float,
        dt: float,
        priority: int,
        *,
        braking: bool = False,
        evasive: bool = False,
    ) -> VelocityCommand:
        """Limit `wanted` (forward, left, up in m/s) and `yaw_rate` (rad/s).

        `dt` is the time since the last command in seconds; `braking` applies the limit `stopping`
        instead of `acceleration`, and `evasive` none. Numbers that are not finite command an
        immediate stop.
        """
        limits = self.limits
        if not np.isfinite([*wanted, yaw_rate]).all():
            self.reset()
            return VelocityCommand(priority=priority)
        flat = wanted[:2]
        climb = float(wanted[2]) if evasive else _clip(float(wanted[2]), limits.climb)
        # Half a circle ahead and half an ellipse behind: convex, so that each velocity between two
        # within the limits is within them, too.
        along = limits.forward if flat[0] >= 0 else limits.backward
        share = float(np.hypot(flat[0] / along, flat[1] / limits.forward))
        if share > 1.0:
            flat = flat / share
        change = np.array([*flat, climb]) - self._velocity
        largest = (limits.stopping if braking else limits.acceleration) * dt
        if not evasive and (size := float(np.linalg.norm(change))) > largest:
            change = change * largest / size
        turn = _clip(yaw_rate, limits.yaw_rate) - self._yaw_rate
        self._velocity = self._velocity + change
        self._yaw_rate += _clip(turn, limits.yaw_acceleration * dt)
        forward, left, up = self._velocity.tolist()
        return VelocityCommand(
            forward, left, up, self._yaw_rate, priority=priority, evasive=evasive
        )


def _clip(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
