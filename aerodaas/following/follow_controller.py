"""From sightings of a target to velocity commands: pure, on the mission's stamps alone.

The drone turns to face the target and moves along the line of sight to keep its distance, by
PID. Where odometry is known, the target's own velocity is fed forward, so that a walking person
is followed without lag: along the line of sight to the speed, across it to the turn. The drone
so flies where its camera looks and comes to stand behind the target, as in pure pursuit. A
target out of sight is followed where it should be for a moment; then the drone slows down,
holds, turns in search, and gives up.
"""

from __future__ import annotations

import enum
import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from simple_pid import PID

from aerodaas.following.approach import ApproachLimit
from aerodaas.following.clearance import Clearance
from aerodaas.following.command_shaper import CommandShaper
from aerodaas.following.follow_settings import FollowGains, FollowLimits, LostPolicy
from aerodaas.following.relative_target import RelativeTarget
from aerodaas.following.target_motion import TargetMotion, place_of, seen_from
from aerodaas.following.upright import Upright
from aerodaas.types.clock import seconds
from aerodaas.types.data import Odometry
from aerodaas.types.waypoints import DEFAULT_PRIORITY, VelocityCommand

__all__ = ["LYING", "FollowController", "FollowPhase", "Observation"]

_LONGEST_STEP = 0.5
"""Seconds; after a longer silence the integrals would grow by what nobody saw."""
_FIRST_STEP = 0.1
_FARTHEST = 1000.0
"""Metres; no camera tells a person from farther away."""
_FARTHEST_FROM_HOME = 1e5
LYING = 1.3
"""Metres from the feet to the chest of one who lies there, at most; in any direction."""
_TOPPLING = 0.4
"""Seconds from a fall's begin until it is known for one."""
_CRAWL = 0.1
"""m/s; what may go on no faster stands."""
_INTEGRAL_REACH = 1.2
"""Metres; a person who walks at 1 m/s is followed so far behind by the proportional part alone."""


class FollowPhase(str, enum.Enum):
    """What the controller is doing about its target."""

    WAITING = "waiting"
    """No target was ever seen, or it was given up: there is nothing to command."""
    FOLLOWING = "following"
    SLOWING = "slowing"
    HOLDING = "holding"
    SEARCHING = "searching"


@dataclass(frozen=True, slots=True)
class Observation:
    """What one frame tells: the target or None, and the drone then and now."""

    stamp: int
    """Nanoseconds of mission time at capture."""
    sighting: RelativeTarget | None
    at_capture: Odometry | None = None
    now: Odometry | None = None
    now_stamp: int | None = None
    others: tuple[RelativeTarget, ...] = ()
    """What else the frame shows that may be the target, or somebody like it."""
    surfaces: NDArray[np.float64] | None = None
    """What the frame's depth shows at the drone's own height, as `clearance.surfaces` gives it."""


class FollowController:
    """Keeps `distance` metres from the target and, where odometry is known, `height` metres up."""

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
        """Wait for a first sighting of what moves as `motion` says, by default as people do.

        Distances in metres, both above zero.
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
        self.blocked = False
        """Whether something stands in the way to the target, so that the drone does not move."""
        self._upright = Upright()
        self._stamp: int | None = None
        self._seen: int | None = None
        self._last: RelativeTarget | None = None
        self._stood: tuple[float, float] | None = None
        """East and north of home where the target stood before it fell."""
        self._places: deque[tuple[int, tuple[float, float]]] = deque()
        """Stamps, and where the target was then, of the last moments."""
        self._braking = False

    def step(self, seen: Observation) -> VelocityCommand | None:
        """Command for one frame; None while there is no target and for stamps that run back."""
        if self._stamp is not None and seen.stamp <= self._stamp:
            return None
        dt = _FIRST_STEP if self._stamp is None else seconds(seen.stamp - self._stamp)
        self._stamp = seen.stamp
        seen = _without_nonsense(seen)
        self._approach.see(seen.sighting, seen.others, seen.at_capture, dt)
        self._clearance.see(seen.surfaces, seen.at_capture, dt)
        if seen.sighting is not None:
            self._take_in(seen.sighting, seen)
        self.phase = self._next_phase(seen.stamp)
        if self.phase is FollowPhase.WAITING:
            self._forget()
            return None
        velocity, yaw_rate = self._wanted(seen, min(dt, _LONGEST_STEP))
        return self._command(velocity, yaw_rate, seen, min(dt, _LONGEST_STEP))

    def give_up(self) -> None:
        """Forget the target at once and wait for another."""
        self.phase = FollowPhase.WAITING
        self._forget()

    def change_target(self) -> None:
        """Forget the target but not the drone's motion: another one is followed from now on."""
        self._seen = self._last = self._stood = None
        self._places.clear()
        self._upright.reset()
        self._reset()

    def expected(self, odometry: Odometry, stamp: int) -> RelativeTarget | None:
        """Where the target should be in a picture taken at `odometry`; None if that is unknown.

        A bound is where the feet of one who fell are: they lie, or get up, within `LYING` of it.
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
        """Keep where the target was of late: the first picture of a fall looks like a long step."""
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

    def _reset(self) -> None:
        self.motion.reset()
        self._distance_pid.reset()
        self._yaw_pid.reset()

    def _wanted(self, seen: Observation, dt: float) -> tuple[NDArray[np.float64], float]:
        """Velocity (forward, left) in m/s and yaw rate in rad/s that the phase asks for."""
        self._braking = self.blocked = False
        # Whoever fell gets up where they fell: they are watched over, not turned away from.
        if self.phase is not FollowPhase.SEARCHING or self._stood is not None:
            return self._follow(seen, dt)
        self._reset()
        if self._last is not None:
            return np.zeros(2), math.copysign(self.lost.search_rate, self._last.bearing)
        return np.zeros(2), 0.0

    def _share(self, stamp: int) -> float:
        """Part of what following asks for that is done, by how long nobody was seen."""
        if self.phase is FollowPhase.SLOWING:
            unseen = seconds(stamp - (self._seen or 0))
            return (self.lost.slow - unseen) / (self.lost.slow - self.lost.coast)
        return 0.0 if self.phase is FollowPhase.HOLDING and self._stood is None else 1.0

    def _follow(self, seen: Observation, dt: float) -> tuple[NDArray[np.float64], float]:
        target, away, left = self._target(seen)
        distance = max(target.distance, self.limits.nearest * self.distance)
        yaw_rate = float(self._yaw_pid(-target.bearing, dt=dt) or 0.0) + left / distance
        error = target.distance - self.distance
        # Far away the integral would only wind up and carry the drone past its place.
        self._distance_pid.Ki = self.gains.distance[1] if abs(error) < _INTEGRAL_REACH else 0.0
        speed = float(self._distance_pid(-error, dt=dt) or 0.0) + away
        now = seen.now or seen.at_capture
        safe = self._approach.speed(target, away, now)
        if target.bound and self._stood is None:
            # Nobody knows how near it is. Of one who fell it is known where the feet are.
            safe = min(safe, 0.0)
        free = self._clearance.speed(target, now)
        self.blocked = free < min(speed, _CRAWL)
        safe = min(safe, free)
        self._braking = self._shaper.towards(target.bearing) > safe
        share = self._share(seen.stamp)
        if share == 0.0 or (speed > safe and safe <= 0.0):
            self._distance_pid.reset()
        # Whoever comes may be out of the picture for being near: backing off goes on.
        speed = share * min(speed, safe) if now is None else min(share * speed, safe)
        direction = np.array([math.cos(target.bearing), math.sin(target.bearing)])
        return speed * direction, share * yaw_rate

    def _target(self, seen: Observation) -> tuple[RelativeTarget, float, float]:
        """The target as it should be now, and how fast it moves away and to the left."""
        last = self._last or RelativeTarget(0.0, self.distance)
        now = seen.now or seen.at_capture
        stamp = max(seen.stamp, seen.now_stamp or 0) if seen.now else seen.stamp
        predicted = None if now is None else self.motion.relative_to(now, stamp)
        if last.bound and predicted is not None:
            # Whoever came nearer until the picture cut them is taken to come on.
            found, away, _ = predicted
            if away >= 0.0:
                return last, 0.0, 0.0
            nearest = last.distance if self._seen == seen.stamp else math.inf
            return replace(last, distance=min(nearest, found.distance)), away, 0.0
        if now is not None and last.bound and self._stood is not None:
            # Whoever lies there has their feet about where they stood, and may get up on them.
            feet = seen_from(now, self._stood)
            if self._seen != seen.stamp:
                last = replace(feet, bound=True)
            nearest = max(feet.distance, last.distance - LYING)
            last = replace(last, distance=min(last.distance, nearest))
        return predicted or (last, 0.0, 0.0)

    def _command(
        self, velocity: NDArray[np.float64], yaw_rate: float, seen: Observation, dt: float
    ) -> VelocityCommand:
        """Keep the height, within the limits of speed and acceleration."""
        odometry = seen.now or seen.at_capture
        climb = 0.0
        if odometry is not None:
            climb = self.gains.height * (self.height - odometry.height)
        wanted = np.array([*velocity, climb])
        if not np.isfinite([*wanted, yaw_rate]).all():
            self._reset()
        return self._shaper.shape(wanted, yaw_rate, dt, self.priority, braking=self._braking)


def _pid(gains: tuple[float, float, float], low: float, high: float) -> PID:
    """A PID that stops integrating at the limits of its output (clamping anti-windup)."""
    return PID(*gains, setpoint=0.0, sample_time=None, output_limits=(low, high))


def _without_nonsense(seen: Observation) -> Observation:
    """Leave out what holds a number that cannot be: it counts as not observed."""
    sighting = seen.sighting if _can_be(seen.sighting) else None
    others = tuple(filter(_can_be, seen.others))
    at_capture = seen.at_capture if _is_sane(seen.at_capture) else None
    now = seen.now if _is_sane(seen.now) else None
    return replace(seen, sighting=sighting, at_capture=at_capture, now=now, others=others)


def _can_be(sighting: RelativeTarget | None) -> bool:
    return (
        sighting is not None
        and abs(sighting.bearing) <= math.pi
        and 0.0 <= sighting.distance <= _FARTHEST
    )


def _is_sane(odometry: Odometry | None) -> bool:
    return (
        odometry is not None
        and bool((np.abs(odometry.position) <= _FARTHEST_FROM_HOME).all())
        and math.isfinite(odometry.yaw)
    )
