"""Follow controller: velocity commands from sightings of a target.

It is pure and depends on message timestamps alone. The drone turns to face the target and moves
along the line of sight to keep its distance, by PID. If odometry is available, the target's own
velocity is fed forward, so that a walking person is followed without lag: along the line of sight
to the speed, across it to the yaw rate. So the drone flies in the direction of its camera and
ends up behind the target, as in pure pursuit. A target out of sight is followed at its predicted
position for a moment; then the drone slows down, holds, turns in search, and gives up.
"""

from __future__ import annotations

import enum
import math
from collections import deque
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from simple_pid import PID

from aerodaas.clock import seconds
from aerodaas.following.contact_guard import ContactGuard
from aerodaas.following.follow_settings import FollowGains, FollowLimits, LostPolicy
from aerodaas.following.steering import ApproachLimit, Clearance, CommandShaper
from aerodaas.following.target import (
    Observation,
    RelativeTarget,
    TargetMotion,
    Upright,
    place_of,
    seen_from,
)
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.waypoints import DEFAULT_PRIORITY, VelocityCommand

__all__ = ["LYING", "FollowController", "FollowPhase"]

_LONGEST_STEP = 0.5
"""Longest time step in seconds, so that the integrals do not grow over a gap between frames."""
_FIRST_STEP = 0.1
LYING = 1.3
"""Greatest distance from the feet to the chest of a lying person in metres, in any direction."""
_TOPPLING = 0.4
"""Seconds from the beginning of a fall until it is detected."""
_DOUBT = 0.3
"""Speed in m/s by which a target must seem slower, from one frame to the next, for the drone to
slow down at once; below, it is noise."""
_PACE = 1.5
"""Time constant of the pace of a walk, seconds."""
_CRAWL = 0.1
"""Speed in m/s below which the drone counts as blocked."""
_INTEGRAL_REACH = 1.2
"""Distance error in metres within which the integral is active; the proportional part alone follows
a person walking at 1 m/s with this error."""
_FED_REACH = 0.4
"""The same where the walk is fed forward: the integral has only wind to make up for, and what it
gathers while catching up would keep the drone too near afterwards."""


class FollowPhase(str, enum.Enum):
    """Phase of following."""

    WAITING = "waiting"
    """No target was detected yet, or it was given up; no commands."""
    FOLLOWING = "following"
    SLOWING = "slowing"
    HOLDING = "holding"
    SEARCHING = "searching"


class FollowController:
    """Keeps `distance` metres from the target and, given odometry, `height` metres above home."""

    def __init__(
        self,
        distance: float,
        height: float,
        *,
        gains: FollowGains | None = None,
        limits: FollowLimits | None = None,
        lost: LostPolicy | None = None,
        motion: TargetMotion | None = None,
        priority: int = DEFAULT_PRIORITY,
    ) -> None:
        """Start in phase WAITING, for a target that moves by `motion`, by default a person.

        `distance` and `height` are in metres, above zero.
        """
        self.distance = distance
        self.height = height
        self.gains = gains or FollowGains()
        self.limits = limits or FollowLimits()
        self.lost = lost or LostPolicy()
        self.priority = priority
        self.phase = FollowPhase.WAITING
        self.motion = motion or TargetMotion()
        limits = self.limits
        self._distance_pid = _pid(self.gains.distance, -limits.backward, limits.forward)
        self._yaw_pid = _pid(self.gains.yaw, -limits.yaw_rate, limits.yaw_rate)
        self._shaper = CommandShaper(limits)
        self._approach = ApproachLimit(limits.nearest * distance, limits)
        self._clearance = Clearance(limits, limits.nearest * distance)
        self.guard = ContactGuard(limits)
        self.blocked = False
        """Whether an obstacle on the path to the target stops the drone."""
        self._upright = Upright()
        self._stamp: int | None = None
        self._seen: int | None = None
        self._last: RelativeTarget | None = None
        self._stood: tuple[float, float] | None = None
        """Position of the target before it fell, metres east and north of home."""
        self._places: deque[tuple[int, tuple[float, float]]] = deque()
        """Timestamps and positions of the target, of the last `_TOPPLING` seconds."""
        self._braking = False
        self._pace = 0.0
        """Speed at which the target walks away, over the last seconds, m/s."""
        self._delay = 0.0
        """Seconds from a target's turn to the command that answers it, at most."""

    def step(self, seen: Observation) -> VelocityCommand | None:
        """Compute the command for one frame; None without a target and for an old timestamp."""
        if self._stamp is not None and seen.stamp <= self._stamp:
            return None
        dt = _FIRST_STEP if self._stamp is None else seconds(seen.stamp - self._stamp)
        self._stamp = seen.stamp
        seen = seen.without_nonsense()
        self._approach.see(seen.sighting, seen.others, seen.at_capture, dt)
        self._clearance.see(seen.surfaces, seen.at_capture, dt)
        dt = min(dt, _LONGEST_STEP)
        self._delay = dt + min(seen.latency, _LONGEST_STEP)
        if seen.sighting is not None:
            self._take_in(seen.sighting, seen)
        # Who falls or gets up seems to leap by a body's length, and comes no nearer.
        fallen = seen.sighting if self._stood is not None else None
        people = [one for one in seen.people if one is not fallen]
        self.guard.see(people, seen.at_capture, seen.stamp, dt, target=seen.sighting)
        self.phase = self._next_phase(seen.stamp)
        if self.phase is FollowPhase.WAITING:
            self._forget()
            return None
        velocity, yaw_rate = self._wanted(seen, dt)
        return self._command(velocity, yaw_rate, seen, dt)

    def give_up(self) -> None:
        """Drop the target at once and wait for another."""
        self.phase = FollowPhase.WAITING
        self._forget()

    def change_target(self) -> None:
        """Drop the target but not the drone's motion, to follow another one from now on."""
        self._pace = 0.0
        self._seen = self._last = self._stood = None
        self._places.clear()
        self._upright.reset()
        self._reset()

    def expected(self, odometry: Odometry, stamp: int) -> RelativeTarget | None:
        """Predicted sighting of the target in a frame.

        A bound locates the feet of a fallen person, who lies, or gets up, within `LYING` of them.

        Args:
            odometry: Odometry of the drone at capture.
            stamp: Mission time of capture, nanoseconds.

        Returns:
            The sighting, or None if it is unknown.
        """
        if self._stood is not None:
            return replace(seen_from(odometry, self._stood), bound=True)
        predicted = self.motion.relative_to(odometry, stamp)
        return None if predicted is None else predicted[0]

    def _take_in(self, sighting: RelativeTarget, seen: Observation) -> None:
        self._seen, self._last = seen.stamp, sighting
        if seen.at_capture is None:
            return
        if sighting.top is not None and not self._upright.stands(
            sighting.top, sighting.distance, seen.stamp
        ):
            self._stood = self._places[0][1] if self._places else self._stood
            self._places.clear()
            self.motion.reset()
            self._last = replace(sighting, bound=True)
        elif not sighting.bound:
            self._stood = None
            falls = sighting.top is not None
            if falls and self.motion.leaps(sighting, seen.at_capture, seen.stamp):
                return
            self.motion.observe(sighting, seen.at_capture, seen.stamp)
            self._remember_place(place_of(sighting, seen.at_capture), seen.stamp)

    def _remember_place(self, place: NDArray[np.float64], stamp: int) -> None:
        """Store a recent position, because the first frame of a fall resembles a long step."""
        self._places.append((stamp, (float(place[0]), float(place[1]))))
        while seconds(stamp - self._places[0][0]) > _TOPPLING:
            self._places.popleft()

    def _next_phase(self, stamp: int) -> FollowPhase:
        if self._seen is None:
            return FollowPhase.WAITING
        unseen = seconds(stamp - self._seen)
        phases = (
            (self.lost.coast, FollowPhase.FOLLOWING),
            (self.lost.slow, FollowPhase.SLOWING),
            (self.lost.hold, FollowPhase.HOLDING),
            (self.lost.search, FollowPhase.SEARCHING),
        )
        return next((phase for until, phase in phases if unseen <= until), FollowPhase.WAITING)

    def _forget(self) -> None:
        self.change_target()
        self._shaper.reset()
        self._approach.reset()
        self.guard.reset()

    def _reset(self) -> None:
        self.motion.reset()
        self._distance_pid.reset()
        self._yaw_pid.reset()

    def _wanted(self, seen: Observation, dt: float) -> tuple[NDArray[np.float64], float]:
        """Velocity (forward, left) in m/s and yaw rate in rad/s that the phase requires."""
        self._braking = self.blocked = False
        # A fallen person gets up at the same place, so the camera stays on it.
        if self.phase is not FollowPhase.SEARCHING or self._stood is not None:
            return self._follow(seen, dt)
        self._reset()
        if self._last is not None:
            return np.zeros(2), math.copysign(self.lost.search_rate, self._last.bearing)
        return np.zeros(2), 0.0

    def _share(self, stamp: int) -> float:
        """Fraction of the command to apply, by the time since the last sighting."""
        if self.phase is FollowPhase.SLOWING:
            unseen = seconds(stamp - (self._seen or 0))
            return (self.lost.slow - unseen) / (self.lost.slow - self.lost.coast)
        return 0.0 if self.phase is FollowPhase.HOLDING and self._stood is None else 1.0

    def _follow(self, seen: Observation, dt: float) -> tuple[NDArray[np.float64], float]:
        target, away, left = self._target(seen)
        distance = max(target.distance, self.limits.nearest * self.distance)
        yaw_rate = float(self._yaw_pid(-target.bearing, dt=dt) or 0.0) + left / distance
        now = seen.pose
        error = target.distance - self._headway(away, dt)
        away = min(away, self.guard.away(now, seen.pose_stamp) + _DOUBT)
        # Far away the integral would only wind up and cause an overshoot.
        reach = _INTEGRAL_REACH if now is None else _FED_REACH
        self._distance_pid.Ki = self.gains.distance[1] if abs(error) < reach else 0.0
        # What the walk leaves of the speed, so that the integral does not wind up behind the limit.
        spare = max(0.0, self.limits.forward - max(0.0, away))
        self._distance_pid.output_limits = (-self.limits.backward, spare)
        speed = float(self._distance_pid(-error, dt=dt) or 0.0) + away
        safe = self._approach.speed(target, away, now)
        if target.bound and self._stood is None:
            # The distance is only an upper bound; for a fallen person, the feet are located.
            safe = min(safe, 0.0)
        free = self._clearance.speed(target, now)
        self.blocked = free < min(speed, _CRAWL)
        safe = min(safe, free)
        self._braking = self._shaper.towards(target.bearing) > safe
        share = self._share(seen.stamp)
        if share == 0.0 or (speed > safe and safe <= 0.0):
            self._distance_pid.reset()
        # An approaching person may be outside the image by being near, so backing off continues.
        speed = share * min(speed, safe) if now is None else min(share * speed, safe)
        direction = np.array([math.cos(target.bearing), math.sin(target.bearing)])
        return speed * direction, share * yaw_rate

    def _headway(self, away: float, dt: float) -> float:
        """Distance in metres to keep: more behind a fast walker, who may turn round."""
        self._pace += min(1.0, dt / _PACE) * (max(away, 0.0) - self._pace)
        return max(self.distance, self.guard.headway(self._pace, self._delay))

    def _target(self, seen: Observation) -> tuple[RelativeTarget, float, float]:
        """Predicted target at present, and its velocity away and to the left, m/s."""
        last = self._last or RelativeTarget(0.0, self.distance)
        now = seen.pose
        predicted = None if now is None else self.motion.relative_to(now, seen.pose_stamp)
        if last.bound and predicted is not None:
            # A person who came nearer until cut by the image's edge is assumed to keep coming.
            found, away, _ = predicted
            if away >= 0.0:
                return last, 0.0, 0.0
            nearest = last.distance if self._seen == seen.stamp else math.inf
            return replace(last, distance=min(nearest, found.distance)), away, 0.0
        if now is not None and last.bound and self._stood is not None:
            # A lying person's feet are about where they stood, and the person may get up there.
            feet = seen_from(now, self._stood)
            if self._seen != seen.stamp:
                last = replace(feet, bound=True)
            nearest = max(feet.distance, last.distance - LYING)
            last = replace(last, distance=min(last.distance, nearest))
        return predicted or (last, 0.0, 0.0)

    def _command(
        self, velocity: NDArray[np.float64], yaw_rate: float, seen: Observation, dt: float
    ) -> VelocityCommand:
        """Add the height control and apply the limits of speed and acceleration."""
        odometry = seen.pose
        climb = 0.0
        if odometry is not None:
            climb = self.gains.height * (self.height - odometry.height)
        wanted = np.array([*velocity, climb])
        evasion = self.guard.evade(odometry, seen.pose_stamp)
        if evasion is not None:
            self._distance_pid.reset()
            wanted = evasion
        if not np.isfinite([*wanted, yaw_rate]).all():
            self._reset()
        return self._shaper.shape(
            wanted, yaw_rate, dt, self.priority, braking=self._braking, evasive=evasion is not None
        )


def _pid(gains: tuple[float, float, float], low: float, high: float) -> PID:
    """A PID that stops integrating at the limits of its output (clamping anti-windup)."""
    return PID(*gains, setpoint=0.0, sample_time=None, output_limits=(low, high))
