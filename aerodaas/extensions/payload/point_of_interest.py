"""Looking at a place while flying: angles for the gimbal, and a heading where it cannot turn.

The angles are computed here and not by the autopilot (MAV_CMD_DO_SET_ROI_LOCATION), so that every
gimbal looks at the same place of the same frame, the simulated one, too, and so that the heading
stays ours: autopilots turn the airframe to their region of interest against our setpoints.
"""

from __future__ import annotations

import math

from aerodaas.clock import NANOSECONDS
from aerodaas.extensions.payload.equipment import Gimbal, GimbalTarget
from aerodaas.geometry.frames import Vector, wrap_angle
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.payload import GimbalAttitude

__all__ = ["AIMED", "PointOfInterest", "direction_to", "fresh", "near"]

AIMED = 0.05
"""Radians of pitch and yaw within which a gimbal looks where it is to: some three degrees, less
than a twentieth of a usual picture."""
_FRESH = NANOSECONDS
"""Nanoseconds for which a gimbal's word counts."""
_NEAREST = 1.0
"""Metres from a place within which it has no direction worth turning to."""
_ABOVE = 0.1
"""Horizontal over vertical distance, under which a place is straight below or above and has no
bearing: within six degrees of it a bearing would turn faster than any gimbal does."""
_PERIOD = NANOSECONDS // 10
"""Nanoseconds between two targets for the gimbal."""
_AGAIN = NANOSECONDS
"""Nanoseconds after which an unchanged target is told again."""
_CHANGED = 0.005
"""Radians by which a target differs that is worth telling."""
_ROUNDING = 1e-6
"""Metres."""
_FACING = 0.1
"""Radians from a place within which a nose looks at it."""


def direction_to(
    place: Vector, position: Vector, bearing: float | None
) -> tuple[float, float | None] | None:
    """Direction of `place` from `position`.

    Args:
        place: What is looked at, ENU metres.
        position: Where the drone is, ENU metres.
        bearing: The one before, radians, which stays where the place is straight below or above;
            None if there was none.

    Returns:
        Pitch, and bearing counter-clockwise from east, radians; None where the place has no
        direction: at it, or for what is not finite.
    """
    east, north, up = (float(axis) for axis in place - position)
    across = math.hypot(east, north)
    if not math.isfinite(across + up) or math.hypot(across, up) < _NEAREST:
        return None
    if across >= max(_ABOVE * abs(up), _ROUNDING):
        bearing = math.atan2(north, east)
    return math.atan2(up, across), bearing


def fresh(attitude: GimbalAttitude | None, now: int) -> GimbalAttitude | None:
    """An attitude that is new and finite; a gimbal may say anything.

    Args:
        attitude: The gimbal's last attitude; None if it has told none.
        now: Mission clock, nanoseconds.

    Returns:
        The attitude, or None for one that is old or not finite.
    """
    if attitude is None or now - attitude.stamp > _FRESH:
        return None
    return attitude if math.isfinite(attitude.pitch) and math.isfinite(attitude.yaw) else None


def near(attitude: GimbalAttitude, aim: GimbalTarget) -> bool:
    """Whether a gimbal looks where it is to.

    Args:
        attitude: Where the gimbal looks.
        aim: Where it is to look.
    """
    pitch = abs(wrap_angle(attitude.pitch - aim.pitch))
    return max(pitch, abs(wrap_angle(attitude.yaw - aim.yaw))) <= AIMED


class PointOfInterest:
    """Place that one drone's gimbal, or its nose, looks at."""

    def __init__(self) -> None:
        """Look at nothing in particular."""
        self.place: Vector | None = None
        """ENU metres; None for nothing in particular."""
        self.heading: float | None = None
        """Where the nose is to look, radians counter-clockwise from east; None as it flies."""
        self.there = False
        """Whether gimbal or nose look at the place."""
        self._bearing: float | None = None
        self._told: GimbalTarget | None = None
        self._clipped: GimbalTarget | None = None
        self._told_at = -_AGAIN
        self._by_nose = False

    def at(self, place: Vector | None) -> None:
        """Look at `place` from now on; None ends it."""
        self.place, self.heading, self.there = place, None, False
        self._bearing = self._told = self._clipped = None
        self._by_nose = False

    def aim(self, gimbal: Gimbal | None, odometry: Odometry, now: int, yaw: float | None) -> None:
        """Aim `gimbal` and the nose from where the drone is.

        Args:
            gimbal: The gimbal; None aims by the nose alone.
            odometry: Where the drone is and where it faces.
            now: Mission clock, nanoseconds.
            yaw: A heading that is asked for otherwise, which the nose keeps, radians; None for
                none.

        Raises:
            Exception: What the gimbal raises.
        """
        if self.place is None:
            return
        self.there = False
        seen = direction_to(self.place, odometry.position, self._bearing)
        if seen is None:
            return
        pitch, self._bearing = seen
        # A gimbal that reached its end once does not give back the nose at each turn.
        self._by_nose = self._by_nose or gimbal is None
        self.heading = self._bearing if self._by_nose and yaw is None else None
        if gimbal is None:
            off = 0.0 if self.heading is None else wrap_angle(self.heading - odometry.yaw)
            self.there = abs(off) <= _FACING
            return
        aside = 0.0 if self._bearing is None else wrap_angle(self._bearing - odometry.yaw)
        target = GimbalTarget(pitch, aside)
        if not math.isfinite(aside):
            return
        clipped = self._command_gimbal(gimbal, target, now)
        turned = abs(wrap_angle(clipped.yaw - aside)) > AIMED
        self._by_nose = self._by_nose or (turned and now == self._told_at)
        aim = GimbalTarget(clipped.pitch, clipped.yaw if self.heading is None else aside)
        attitude = fresh(gimbal.attitude, now)
        self.there = attitude is not None and near(attitude, aim)

    def _command_gimbal(self, gimbal: Gimbal, target: GimbalTarget, now: int) -> GimbalTarget:
        """Command the gimbal where that is due; returns the target within its range."""
        told, clipped = self._told, self._clipped
        if told is not None and clipped is not None:
            moved = max(
                abs(wrap_angle(target.pitch - told.pitch)), abs(wrap_angle(target.yaw - told.yaw))
            )
            if now - self._told_at < (_PERIOD if moved > _CHANGED else _AGAIN):
                return clipped
        self._told, self._told_at = target, now
        self._clipped = gimbal.aim(target)
        return self._clipped
