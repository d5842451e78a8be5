"""Controller of a tower inspection: approach to a stand-off, climb along the tower, descent.

It is a pure state machine on message timestamps. The tower's position is estimated from all
sightings. The approach is braked so that the drone stops at the stand-off, and too near a drone
backs away at once. Loss of the tower and the time limit lead to the descent, and the descent to
the end.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

import numpy as np

from aerodaas.clock import seconds
from aerodaas.errors import ConfigError
from aerodaas.following.follow_settings import FollowLimits
from aerodaas.following.steering import Clearance, CommandShaper
from aerodaas.following.target import Observation, RelativeTarget, TargetMotion
from aerodaas.geometry.braking import braking_speed
from aerodaas.geometry.frames import wrap_angle
from aerodaas.messages.waypoints import DEFAULT_PRIORITY, VelocityCommand

__all__ = ["InspectionController", "InspectionPhase", "InspectionPlan"]

_LONGEST_STEP = 0.5
_CONFIRMED = 3
"""Number of sightings that start the approach."""
_MEMORY = 2.0
"""Seconds within which these sightings must occur."""
_FRESH = 1.0
"""Seconds after a sighting in which the drone still moves towards the tower."""
_CLOSE = 0.5
_LEVEL = 0.3
"""Tolerances of the stand-off and of a height, metres."""
_REACTION = 0.6
"""Seconds from capture to the drone's response."""
_SEARCH_RATE = 0.3
_FARTHER = 1.25
"""Ratio to the estimated distance above which a sighting shows only a part of the tower."""


@dataclass(frozen=True, slots=True)
class InspectionPlan:
    """Parameters of an inspection, in metres, m/s and seconds.

    Raises ConfigError for numbers out of range.
    """

    stand_off: float = 8.0
    """Least distance along the ground from the tower's near side."""
    base: float = 2.0
    """Height at which the climb begins and the descent ends."""
    top: float = 35.0
    interval: float = 2.0
    """Height between two images."""
    speed: float = 1.5
    """Speed of the approach."""
    climb: float = 1.0
    patience: float = 20.0
    """Time without a sighting of the tower after which the inspection ends."""
    longest: float = 600.0
    """Longest time from the beginning to the descent."""
    farthest: float = 100.0
    """Greatest distance of a tower to inspect."""

    def __post_init__(self) -> None:
        """Validate the numbers."""
        for name in self.__slots__:
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise ConfigError(f"inspection: {name} must be above 0, not {value}")
        if self.top <= self.base:
            raise ConfigError(f"inspection: top must lie above base={self.base}, not at {self.top}")


class InspectionPhase(str, enum.Enum):
    """Phase of the inspection."""

    WAITING = "waiting"
    """No tower has been detected, or in fewer than three frames; no commands."""
    APPROACHING = "approaching"
    CLIMBING = "climbing"
    DESCENDING = "descending"
    DONE = "done"


class InspectionController:
    """Controller of one inspection by `plan`."""

    def __init__(self, plan: InspectionPlan, priority: int = DEFAULT_PRIORITY) -> None:
        """Start in phase WAITING; `priority` is that of the commands."""
        self.plan = plan
        self.priority = priority
        self.phase = InspectionPhase.WAITING
        self.reason = ""
        """Reason why the climb ended before the top; empty if it did not."""
        self.picture_due: float | None = None
        """Height in metres if the frame last stepped is an image to keep, else None."""
        self.motion = TargetMotion(acceleration=0.0, speed=0.0)
        limits = FollowLimits(plan.speed, plan.speed, max(plan.climb, 0.5), 0.8, 1.0, 2.0)
        self._shaper = CommandShaper(limits)
        self._clearance = Clearance(limits, plan.stand_off)
        self._sightings: list[int] = []
        self._began = self._seen = 0
        self._stamp: int | None = None
        self._next_picture = plan.base

    def step(self, seen: Observation) -> VelocityCommand | None:
        """Compute the command for one frame; None without a tower or odometry."""
        self.picture_due = None
        if self._stamp is not None and seen.stamp <= self._stamp:
            return None
        dt = 0.1 if self._stamp is None else seconds(seen.stamp - self._stamp)
        self._stamp = seen.stamp
        self._take_in(seen)
        self._clearance.see(seen.surfaces, seen.at_capture, dt)
        now = seen.now or seen.at_capture
        if self.phase is InspectionPhase.WAITING or now is None:
            return None
        relative = self.motion.relative_to(now, seen.stamp)
        position = np.array([*now.position, now.yaw])
        if relative is None or not np.isfinite(position).all():
            return self._shaper.shape(np.zeros(3), 0.0, dt, self.priority)
        distance, bearing = relative[0].distance, relative[0].bearing
        if seen.sighting is not None and seen.sighting.bound:
            distance = min(distance, seen.sighting.distance)
        self._advance(distance, now.height, seen.stamp)
        unseen = seconds(seen.stamp - self._seen)
        free = self._clearance.speed(relative[0], now)
        along = min(self._along(distance, unseen), free)
        wanted = [along * math.cos(bearing), along * math.sin(bearing), self._climb(now.height)]
        yaw_rate = 1.5 * wrap_angle(bearing)
        if self.phase is InspectionPhase.APPROACHING and unseen > _MEMORY:
            yaw_rate = math.copysign(_SEARCH_RATE, bearing)
        if self.phase is InspectionPhase.DONE:
            wanted, yaw_rate = [0.0, 0.0, 0.0], 0.0
        step, braking = min(dt, _LONGEST_STEP), self._shaper.towards(bearing) > free
        velocity = np.array(wanted)
        return self._shaper.shape(velocity, yaw_rate, step, self.priority, braking=braking)

    def _take_in(self, seen: Observation) -> None:
        sighting = seen.sighting
        if sighting is None or not 0.0 <= sighting.distance <= self.plan.farthest:
            return
        if self._seems_farther(sighting, seen):
            return
        self._seen = seen.stamp
        if sighting.bound or seen.at_capture is None:
            return
        self.motion.observe(sighting, seen.at_capture, seen.stamp)
        if self.phase is InspectionPhase.WAITING:
            recent = [at for at in self._sightings if seconds(seen.stamp - at) <= _MEMORY]
            self._sightings = [*recent, seen.stamp]
            if not recent:
                self.motion.reset()
                self.motion.observe(sighting, seen.at_capture, seen.stamp)
            if len(self._sightings) >= _CONFIRMED:
                self.phase, self._began = InspectionPhase.APPROACHING, seen.stamp

    def _seems_farther(self, sighting: RelativeTarget, seen: Observation) -> bool:
        """Whether a sighting shows only a part of the tower, which is static and was nearer."""
        if self.phase is InspectionPhase.WAITING or sighting.bound or seen.at_capture is None:
            return False
        known = self.motion.relative_to(seen.at_capture, seen.stamp)
        return known is not None and sighting.distance > _FARTHER * known[0].distance

    def _advance(self, distance: float, height: float, stamp: int) -> None:
        plan = self.plan
        in_place = abs(distance - plan.stand_off) <= _CLOSE
        in_place &= abs(height - plan.base) <= _LEVEL
        if self.phase is InspectionPhase.APPROACHING and in_place:
            self.phase = InspectionPhase.CLIMBING
        if self.phase is InspectionPhase.CLIMBING:
            if height >= self._next_picture - _LEVEL:
                self.picture_due = height
                self._next_picture += plan.interval
            if height >= plan.top - _LEVEL:
                self.phase = InspectionPhase.DESCENDING
        if self.phase in {InspectionPhase.APPROACHING, InspectionPhase.CLIMBING}:
            if seconds(stamp - self._seen) > plan.patience:
                self._end("the tower is out of sight")
            elif seconds(stamp - self._began) > plan.longest:
                self._end(f"it has taken {plan.longest:g} s")
        if self.phase is InspectionPhase.DESCENDING and height <= plan.base + _LEVEL:
            self.phase = InspectionPhase.DONE

    def _end(self, reason: str) -> None:
        self.phase, self.reason = InspectionPhase.DESCENDING, reason

    def _along(self, distance: float, unseen: float) -> float:
        """Speed towards the tower, m/s; negative if it is too near."""
        room = distance - self.plan.stand_off
        if room < 0:
            return max(2.0 * room, -self.plan.speed)
        if unseen > _FRESH or self.phase is not InspectionPhase.APPROACHING:
            return 0.0
        return min(self.plan.speed, braking_speed(room, 0.5, _REACTION), 0.8 * room)

    def _climb(self, height: float) -> float:
        plan = self.plan
        if self.phase is InspectionPhase.APPROACHING:
            # From a greater height the foot of a near tower is outside the image.
            return max(min(plan.base - height, 0.8 * plan.climb), -plan.climb)
        target = plan.top if self.phase is InspectionPhase.CLIMBING else plan.base
        way = target - height
        speed = min(plan.climb, braking_speed(abs(way), 0.5, _REACTION) + 0.1)
        return math.copysign(min(speed, 2.0 * abs(way) + 0.05), way)
