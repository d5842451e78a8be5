"""Limits of a follower's commands: approach to people, clear way ahead, speed and acceleration.

A follower flies along its line of sight, which may graze the corner of a wall. No path around an
obstacle is planned: the drone stops in front of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from aerodaas.following.follow_settings import FollowLimits
from aerodaas.following.target import RelativeTarget, place_of, seen_from
from aerodaas.geometry.braking import braking_speed
from aerodaas.geometry.depth import METRE
from aerodaas.geometry.frames import Vector, rotation_from_rpy
from aerodaas.messages.detections import Detections
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.waypoints import VelocityCommand

__all__ = ["ApproachLimit", "Clearance", "CommandShaper", "closing_speed", "surfaces"]

_AHEAD = 0.7
"""Angle off the direction of flight within which a person is in the path, radians."""
_LONGEST_BLIND = 1.0
"""Longest interval between two frames that is considered, seconds; a target unseen for longer is
lost."""


def closing_speed(gap: float, deceleration: float, reaction_time: float) -> float:
    """Highest safe speed (m/s) towards a person.

    For a positive gap as `braking_speed`. For a negative gap it is negative, so that the drone
    backs away; the slope is 1 / `reaction_time` on both sides of zero. Keeping below it makes gap
    >= 0 a forward invariant (control barrier function: Ames et al., "Control barrier functions:
    theory and applications", ECC 2019).

    Args:
        gap: Metres beyond the least safe distance.
        deceleration: Braking in m/s².
        reaction_time: Seconds until braking begins.
    """
    return gap / reaction_time if gap < 0.0 else braking_speed(gap, deceleration, reaction_time)


class ApproachLimit:
    """Speed limit by the positions of people in the newest frames, who are assumed to stand still.

    A person walking away may stop at any moment, so their walking allows no higher speed. All
    detected people count, not only the target: identity does not matter to a collision.
    """

    def __init__(self, nearest: float, limits: FollowLimits) -> None:
        """Keep the drone at least `nearest` metres away from people."""
        self.nearest = nearest
        self.limits = limits
        self._places: list[Vector] = []
        self._sightings: list[RelativeTarget] = []
        self._target = False
        """Whether the first of them is the target."""
        self._blind = 0.0
        """Interval between frames in seconds, added to the reaction time, so that a drone with a
        low frame rate keeps farther away. The latency of frames needs no allowance, because people
        are assumed to have stopped at capture."""

    def reset(self) -> None:
        """Discard all sightings."""
        self._places, self._sightings = [], []

    def see(
        self,
        target: RelativeTarget | None,
        others: Iterable[RelativeTarget],
        at_capture: Odometry | None,
        interval: float,
    ) -> None:
        """Store the people in a frame.

        A frame without people keeps their previous positions.

        Args:
            target: The followed person; None if not seen.
            others: Everybody and everything else in the way.
            at_capture: Odometry of the drone at capture; None if unknown.
            interval: Seconds since the last frame.
        """
        self._blind = min(interval, _LONGEST_BLIND)
        seen = [*([] if target is None else [target]), *others]
        if not seen:
            return
        self._target = target is not None
        self._sightings, self._places = seen, []
        if at_capture is not None:
            self._places = [place_of(one, at_capture) for one in seen]

    def speed(self, towards: RelativeTarget, away: float, now: Odometry | None) -> float:
        """Highest safe speed towards the target.

        A target walking away allows no more speed than a standing one, and a drone that gains on it
        has less room than measured, by the airframe's response time. Others in the path stop the
        drone, but do not drive it back.

        Args:
            towards: The target, relative to the drone now.
            away: Speed in m/s at which it moves away.
            now: Newest odometry of the drone; None if unknown.

        Returns:
            Metres per second; negative if the drone must back off.
        """
        seen = list(self._distances(towards.bearing, now))
        target = min([towards.distance, *(far for far, is_target in seen if is_target)])
        target -= self.limits.response * max(0.0, _speed(now, towards.bearing) - max(away, 0.0))
        others = [self._closing(far) for far, is_target in seen if not is_target]
        speed = self._closing(target) + min(away, 0.0)
        return min(speed, max(0.0, min(others))) if others else speed

    def _closing(self, distance: float) -> float:
        reaction_time = self.limits.reaction_time + self._blind
        return closing_speed(distance - self.nearest, self.limits.braking, reaction_time)

    def _distances(self, bearing: float, now: Odometry | None) -> Iterator[tuple[float, bool]]:
        """Distance of each person in the path, and whether it is the target."""
        seen = self._sightings
        if now is not None:
            seen = [seen_from(now, (float(x), float(y))) for x, y in self._places]
        for number, one in enumerate(seen):
            off = abs(math.remainder(one.bearing - bearing, math.tau))
            if off <= _AHEAD:
                yield one.distance, self._target and number == 0


def _speed(now: Odometry | None, bearing: float) -> float:
    """Speed of the drone towards `bearing` in m/s; zero if unknown."""
    if now is None or not np.isfinite(now.velocity).all():
        return 0.0
    heading = now.yaw + bearing
    return float(now.velocity[:2] @ (math.cos(heading), math.sin(heading)))


_BELOW, _ABOVE = 0.5, 0.4
"""Vertical distances in metres from the body's centre within which a surface is an obstacle."""
_GROUND = 0.3
"""Height above home in metres below which a surface is the ground, or an object lying on it."""
_HALF_WIDTH = 0.5
"""Half the width of the corridor in metres: half a drone, and its displacement by wind."""
_BEFORE = 0.8
"""Distance of the body's centre from a surface at which the drone stops, metres."""
_BODY = 0.7
"""Radius around the target within which surfaces belong to it, metres; `ApproachLimit` keeps the
distance to the target itself."""


def surfaces(seen: Detections) -> NDArray[np.float64] | None:
    """Positions (n, 2) of the surfaces at the drone's own height, metres forward and left.

    In the level body frame. None if the frame has no depth or the camera is not calibrated.
    """
    cells, camera, odometry = seen.nearest, seen.camera, seen.odometry
    if cells is None or camera is None:
        return None
    rows, columns = np.nonzero(cells)
    u = (columns + 0.5) * camera.width / cells.shape[1]
    v = (rows + 0.5) * camera.height / cells.shape[0]
    depth = cells[rows, columns] / METRE
    sides, downs = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    optical = depth[:, None] * np.stack([sides, downs, np.ones_like(u)], axis=-1)
    level, floor = np.eye(3), -math.inf
    if odometry is not None and math.isfinite(odometry.roll + odometry.pitch + odometry.height):
        level = rotation_from_rpy(odometry.roll, odometry.pitch, 0.0)
        floor = _GROUND - odometry.height
    points = (optical @ camera.body_from_optical.T + np.array(camera.mount)) @ level.T
    up = points[:, 2]
    return np.asarray(points[(up > max(-_BELOW, floor)) & (up < _ABOVE), :2])


class Clearance:
    """Speed limit by the surfaces of the newest depth image, which are assumed to be static."""

    def __init__(self, limits: FollowLimits, nearest: float) -> None:
        """Stop 0.8 m before an obstacle, or `nearest` metres if that is less."""
        self._limits = limits
        self._before = min(_BEFORE, nearest)
        self._points: NDArray[np.float64] = np.zeros((0, 2))
        self._at: Odometry | None = None
        self._interval = 0.0

    def see(
        self, points: NDArray[np.float64] | None, at_capture: Odometry | None, interval: float
    ) -> None:
        """Store the surfaces of a frame.

        Args:
            points: Surfaces, (N, 2), metres forward and left; None, for a frame without depth,
                keeps the last.
            at_capture: Odometry of the drone at capture; None if unknown.
            interval: Seconds since the last frame.
        """
        if points is not None:
            self._points, self._at, self._interval = points, at_capture, interval

    def speed(self, towards: RelativeTarget, now: Odometry | None) -> float:
        """Highest safe speed along the line of sight.

        Args:
            towards: The target at its end, relative to the drone now.
            now: Newest odometry of the drone; None if unknown.

        Returns:
            Metres per second; infinite if the line is free.
        """
        points = self._points
        if self._at is not None and now is not None:
            east_north = self._at.position[:2] + points @ _rotation(self._at.yaw).T
            points = (east_north - now.position[:2]) @ _rotation(now.yaw)
        points = points[np.linalg.norm(points - towards.offset, axis=1) > _BODY]
        along, aside = (points @ _rotation(towards.bearing)).T
        ahead = along[(along > 0.0) & (along < towards.distance) & (np.abs(aside) < _HALF_WIDTH)]
        if not ahead.size:
            return math.inf
        reaction_time = self._limits.reaction_time + self._interval
        return braking_speed(float(ahead.min()) - self._before, self._limits.braking, reaction_time)


def _rotation(angle: float) -> NDArray[np.float64]:
    """Rotation matrix (2, 2), counter-clockwise."""
    return rotation_from_rpy(0.0, 0.0, angle)[:2, :2]


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
        """Limit a velocity and a yaw rate.

        Numbers that are not finite command an immediate stop.

        Args:
            wanted: Forward, left and up in m/s.
            yaw_rate: Radians per second.
            dt: Seconds since the last command.
            priority: Priority of the command.
            braking: Apply the limit `stopping` instead of `acceleration`.
            evasive: Apply no limit of acceleration, nor of climbing.
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
