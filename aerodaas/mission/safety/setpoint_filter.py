"""The final safety filter on every setpoint: limits that clamp, boundaries to stop before.

Boundaries (geofence, range, ground, other drones, aircraft) bound the speed towards them by the
remaining braking distance, a control barrier: whatever the previous setpoints, the drone can still
stop in time, and standing still is always allowed. Motion along a boundary or away from it is left
alone, so that a drone that was blown outside can come back.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from aerodaas.config.model import LimitsConfig
from aerodaas.geometry.braking import braking_speed, limit_length, velocity_towards
from aerodaas.geometry.frames import Vector, is_close, is_finite, length
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import PositionSetpoint, Setpoint, VelocitySetpoint
from aerodaas.mission.safety.geofence import Geofence
from aerodaas.mission.safety.ground_clearance import GroundClearance, GroundView, climb_speed
from aerodaas.mission.safety.neighbours import Neighbour

__all__ = ["FilteredSetpoint", "SetpointFilter"]

_DOWN = np.array([0.0, 0.0, -1.0])
_LIMITS = frozenset({"max_speed", "max_climb", "max_acceleration", "max_yaw_rate"})
"""Names of what bounds a setpoint and is no boundary."""
_NOISE = 0.5
"""m/s too fast towards a boundary that are no reason to intervene: a hover in wind has them."""
_FEW = 4
"""Neighbours up to which it takes longer to tell the near ones than to bound by all."""
_ROUNDING = 1e-3
"""Metres by which a neighbour is taken to be nearer than it is, and that are no lack of room."""


@dataclass(frozen=True, slots=True, eq=False)
class FilteredSetpoint:
    """A setpoint that is safe to send, and the names of the limits that changed it."""

    setpoint: Setpoint
    clipped_by: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class _Bound:
    """At most `speed` m/s along the unit vector `towards`."""

    name: str
    towards: Vector
    speed: float


class SetpointFilter:
    """Clamps the setpoints of one drone to its limits."""

    def __init__(
        self,
        limits: LimitsConfig,
        home: Vector,
        *,
        position_setpoints: bool = True,
        clearance: GroundClearance | None = None,
    ) -> None:
        """Guard a drone that took off at `home` (ENU metres).

        Without `position_setpoints`, position setpoints become velocities towards their targets.
        With a `clearance`, the drone keeps above the ground, and away from where it is unknown.
        """
        self.limits = limits
        self.home = home
        self._clearance = clearance
        self.fence = Geofence(limits.geofence, clearance.unknown if clearance else None)
        self._position_setpoints = position_setpoints
        self._yaw_rate = math.radians(limits.max_yaw_rate)
        self._last: Vector | None = None
        self._below: float | None = None

    def clamp(
        self,
        setpoint: Setpoint,
        odometry: Odometry,
        duration: float,
        neighbours: Iterable[Neighbour] = (),
        *,
        below: float | None = None,
    ) -> FilteredSetpoint:
        """Make `setpoint` safe to follow for `duration` from the drone's odometry.

        A setpoint with a number that is not finite becomes standing still (`not_finite`).

        Args:
            setpoint: As requested.
            odometry: Where the drone is and how it moves.
            duration: Seconds.
            neighbours: The other drones and aircraft to keep away from.
            below: Metres down to what a rangefinder sees there; None where it sees nothing.
        """
        if not _finite(setpoint):
            self._last = np.zeros(3)
            return FilteredSetpoint(VelocitySetpoint(np.zeros(3)), ("not_finite",))
        if not (is_finite(odometry.position) and is_finite(odometry.velocity)):
            return self._blind(setpoint)
        self._below = below
        if isinstance(setpoint, PositionSetpoint):
            return self._clamp_position(setpoint, odometry, neighbours)
        velocity, names = self._limit(setpoint.velocity)
        before = odometry.velocity if self._last is None else self._last
        change = limit_length(velocity - before, self.limits.max_acceleration * duration)
        # The ramp would delay giving way by most of a second; the vehicle limits it by itself.
        if not setpoint.evasive and not np.array_equal(change, velocity - before):
            velocity, names = self._limit(before + change)[0], [*names, "max_acceleration"]
        velocity, bounds = self._stop_before_boundaries(velocity, odometry, neighbours)
        yaw_rate = float(np.clip(setpoint.yaw_rate, -self._yaw_rate, self._yaw_rate))
        if yaw_rate != setpoint.yaw_rate:
            names.append("max_yaw_rate")
        self._last = velocity
        return FilteredSetpoint(VelocitySetpoint(velocity, yaw_rate), (*names, *bounds))

    def crossed(
        self,
        odometry: Odometry,
        neighbours: Iterable[Neighbour] = (),
        *,
        below: float | None = None,
    ) -> tuple[str, ...]:
        """Boundaries before which a drone that flies on as it does may not stop in time.

        It is for a drone that follows no setpoints.

        Args:
            odometry: Where the drone is and how it moves.
            neighbours: The other drones and aircraft to keep away from.
            below: Metres down to what a rangefinder sees there; None where it sees nothing.

        Returns:
            Their names; empty if all is well.
        """
        self.forget()
        onwards = VelocitySetpoint(odometry.velocity, evasive=True)
        clamped = self.clamp(onwards, odometry, 0.0, neighbours, below=below)
        self.forget()
        names = tuple(name for name in clamped.clipped_by if name not in _LIMITS)
        assert isinstance(clamped.setpoint, VelocitySetpoint)  # noqa: S101 - as it was asked for
        if length(clamped.setpoint.velocity - odometry.velocity) > _NOISE:
            return names
        return () if self.fence.inside(odometry.position) else ("geofence",)

    def forget(self) -> None:
        """Start the next acceleration from the measured velocity, after an interruption."""
        self._last = None

    def _clamp_position(
        self, asked: PositionSetpoint, odometry: Odometry, neighbours: Iterable[Neighbour]
    ) -> FilteredSetpoint:
        names: list[str] = []
        target = self.home + limit_length(asked.position - self.home, self.limits.max_range)
        if not is_close(target, asked.position):
            names.append("max_range")
        if self._clearance is not None:
            raised = self._clearance.raised(target)
            names += ["ground"] if raised is not target else []
            target = raised
        # What the fence allows nearest to a place in range may itself be out of range.
        inside = self.fence.nearest_within(target, self.home, self.limits.max_range)
        if inside is None:
            self._last = np.zeros(3)
            return FilteredSetpoint(VelocitySetpoint(np.zeros(3)), (*names, "geofence"))
        if not is_close(inside, target):
            names.append("geofence")
        target = inside
        limits = self.limits
        wished = asked.speed or limits.cruise_speed
        if not is_close(target, asked.position):
            # At a place that was moved, the way on is another one: the drone stops there.
            asked = PositionSetpoint(target, asked.yaw, asked.speed)
        velocity = velocity_towards(
            asked,
            odometry.position,
            odometry.yaw,
            speed=wished,
            deceleration=limits.max_acceleration,
            reaction_time=limits.reaction_time,
            yaw_rate=self._yaw_rate,
        )
        speed = self._speed_towards(target - odometry.position, wished)
        if speed < wished:
            names.append("max_climb" if speed < limits.max_speed else "max_speed")
        free = limit_length(velocity.velocity, speed)
        bounded, bounds = self._stop_before_boundaries(free, odometry, neighbours)
        if bounds or not self._position_setpoints:
            self._last = bounded
            return FilteredSetpoint(VelocitySetpoint(bounded, velocity.yaw_rate), (*names, *bounds))
        self._last = None
        sent = replace(asked, speed=speed, passing_speed=min(asked.passing_speed, speed))
        return FilteredSetpoint(sent, tuple(names))

    def _blind(self, setpoint: Setpoint) -> FilteredSetpoint:
        """Allow only turning on the spot: without a position no boundary can be kept."""
        self._last = np.zeros(3)
        still = VelocitySetpoint(np.zeros(3))
        moves = isinstance(setpoint, PositionSetpoint) or bool(setpoint.velocity.any())
        return FilteredSetpoint(still, ("no_position",) if moves else ())

    def _limit(self, velocity: Vector) -> tuple[Vector, list[str]]:
        names: list[str] = []
        limited = velocity.astype(np.float64)
        horizontal = limit_length(velocity[:2], self.limits.max_speed)
        if not np.array_equal(horizontal, velocity[:2]):
            names.append("max_speed")
        climb = float(np.clip(velocity[2], -self.limits.max_climb, self.limits.max_climb))
        if climb != velocity[2]:
            names.append("max_climb")
        limited[:2], limited[2] = horizontal, climb
        return limited, names

    def _speed_towards(self, way: Vector, speed: float) -> float:
        """The highest speed along `way` within both the horizontal and the vertical speed limit."""
        distance = length(way)
        level, upright = math.hypot(way[0], way[1]), abs(float(way[2]))
        if level > 0.0:
            speed = min(speed, self.limits.max_speed * distance / level)
        if upright > 0.0:
            speed = min(speed, self.limits.max_climb * distance / upright)
        return speed

    def _stop_before_boundaries(
        self, velocity: Vector, odometry: Odometry, neighbours: Iterable[Neighbour]
    ) -> tuple[Vector, list[str]]:
        bounds = self._bounds(velocity, odometry, neighbours)
        raised, ground = self._clear_of_ground(velocity, odometry)
        bounds += ground
        names = ["ground"] if raised is not velocity else []
        # The other boundaries have the last word: it climbs through no ceiling.
        velocity = raised
        sweeps = 4  # alternating projections; scaling down below removes the remainder
        for _ in range(sweeps):
            before = velocity
            for bound in bounds:
                excess = float(velocity @ bound.towards) - bound.speed
                if excess > 0.0:
                    velocity = velocity - excess * bound.towards
                    if bound.name not in names:
                        names.append(bound.name)
            if velocity is before:
                return velocity, names  # within all bounds, as further sweeps would leave it
        for bound in bounds:
            closing = float(velocity @ bound.towards)
            if closing > bound.speed:
                velocity = velocity * (bound.speed / closing)
        return velocity, names

    def _clear_of_ground(self, velocity: Vector, odometry: Odometry) -> tuple[Vector, list[_Bound]]:
        """`velocity`, climbing and slowed down where the ground is too near, and bounds downwards.

        By the terrain, which is known ahead, and by what a rangefinder sees below.
        """
        bounds: list[_Bound] = []
        if self._clearance is not None:
            view = self._clearance.view(odometry.position, odometry.velocity, velocity)
            bounds.append(self._bound("ground", _DOWN, view.room_below(), odometry))
            velocity = self._over_ground(velocity, view, odometry)
        if self._below is not None and self.limits.rangefinder_clearance > 0.0:
            room = self._below - self.limits.rangefinder_clearance
            bounds.append(self._bound("ground", _DOWN, room, odometry))
            velocity = self._off_ground(velocity, room)
        return velocity, bounds

    def _bounds(
        self, velocity: Vector, odometry: Odometry, neighbours: Iterable[Neighbour]
    ) -> list[_Bound]:
        position = odometry.position
        bounds = [*self._fence_bounds(odometry), *self._height_bounds(odometry)]
        outwards = position - self.home
        away = length(outwards)
        if away > 0.0:
            room = self.limits.max_range - away
            bounds.append(self._bound("max_range", outwards / away, room, odometry))
        drones = list[Neighbour]()
        for neighbour in neighbours:
            if neighbour.apart is None:
                drones.append(neighbour)
            else:
                bounds += self._aircraft_bounds(neighbour, neighbour.apart, odometry)
        for neighbour in self._near(velocity, odometry, drones):
            way = neighbour.position - position
            distance = length(way)
            # Both drones brake, so each may use half of the room between them.
            room = (distance - self.limits.separation) / 2
            if distance > 0.0:
                bounds.append(self._bound("separation", way / distance, room, odometry))
        return bounds

    def _aircraft_bounds(
        self, aircraft: Neighbour, apart: tuple[float, float], odometry: Odometry
    ) -> list[_Bound]:
        """Bounds towards what flies on while this drone brakes.

        Distance or height keeps them apart, and that is kept of which there is more.
        """
        way = aircraft.position - odometry.position
        limits, rooms = self.limits, list[tuple[float, Vector]]()
        braking = limits.reaction_time + limits.max_speed / limits.max_acceleration
        for part, least in ((_level(way), apart[0]), (way - _level(way), apart[1])):
            distance = length(part)
            if not math.isfinite(distance):
                continue  # its height is not known, and keeps nothing apart
            # Right above or below, and at the very same height, every way leads away.
            towards = part / distance if distance > 0.0 else np.zeros(3)
            nearer = max(0.0, -float(aircraft.velocity @ towards)) * braking
            rooms.append((distance - least - nearer, towards))
        most = max(room for room, _ in rooms)
        return [
            self._bound(aircraft.limit, towards, room, odometry)
            for room, towards in rooms
            if room == most or most <= 0.0
        ]

    def _near(
        self, velocity: Vector, odometry: Odometry, neighbours: list[Neighbour]
    ) -> list[Neighbour]:
        """Neighbours to keep away from; of many, those that may bound the speed asked for.

        All bounds allow standing still, so none of them makes a velocity longer; only the climb
        over rising ground may.
        """
        if self.limits.separation <= 0.0:
            return []
        if len(neighbours) <= _FEW:
            return neighbours
        limits, climb = self.limits, max(abs(float(velocity[2])), self.limits.max_climb)
        fastest = math.hypot(velocity[0], velocity[1], climb)
        reaction = (fastest + length(odometry.velocity)) * limits.reaction_time
        room = reaction + fastest * fastest / (2 * limits.max_acceleration)
        reach = limits.separation + 2 * room + _ROUNDING
        ways = np.array([neighbour.position for neighbour in neighbours]) - odometry.position
        near = np.einsum("ij,ij->i", ways, ways) <= reach * reach
        return [neighbours[index] for index in np.flatnonzero(near)]

    def _off_ground(self, velocity: Vector, room: float) -> Vector:
        """`velocity`, climbing where `room` metres below are missing, and slower the more are.

        A rangefinder does not look ahead: at half of its clearance the drone only climbs.
        """
        if room >= -_ROUNDING:
            return velocity
        share = max(0.0, 1.0 + room / (self.limits.rangefinder_clearance / 2))
        climb = max(float(velocity[2]), climb_speed(-room, self.limits))
        return np.array([share * velocity[0], share * velocity[1], climb])

    def _over_ground(self, velocity: Vector, view: GroundView, odometry: Odometry) -> Vector:
        """`velocity`, slowed down before higher ground, and climbing to pass over it."""
        share = 1.0
        for way, room in view.walls():
            closing = float(velocity @ way)
            speed = self._bound("ground", way, room, odometry).speed
            if closing > speed:
                share = min(share, speed / closing)
        climb = max(float(velocity[2]), view.climb())
        if share == 1.0 and climb == velocity[2]:
            return velocity
        return np.array([share * velocity[0], share * velocity[1], climb])

    def _fence_bounds(self, odometry: Odometry) -> list[_Bound]:
        fence, position = self.fence, odometry.position
        if fence.area is None:
            return []
        if not fence.inside(position):
            way = position[:2] - fence.nearest_allowed(position)[:2]
            return [_Bound("geofence", _level(way / np.linalg.norm(way)), 0.0)]
        limits = self.limits
        reach = fence.margin + limits.max_speed * (
            2 * limits.reaction_time + limits.max_speed / (2 * limits.max_acceleration)
        )
        towards, distances = fence.edges_near(position, reach)
        return [
            self._bound("geofence", _level(way), float(distance) - fence.margin, odometry)
            for way, distance in zip(towards, distances, strict=True)
        ]

    def _height_bounds(self, odometry: Odometry) -> tuple[_Bound, _Bound]:
        upwards = np.array([0.0, 0.0, 1.0])
        height = float(odometry.position[2])
        return (
            self._bound("ceiling", upwards, self.fence.ceiling - height, odometry),
            self._bound("floor", -upwards, height - self.fence.floor, odometry),
        )

    def _bound(self, name: str, towards: Vector, room: float, odometry: Odometry) -> _Bound:
        """Bound the speed by the room that is left after the vehicle's reaction time."""
        limits = self.limits
        flown_on = max(0.0, float(odometry.velocity @ towards)) * limits.reaction_time
        speed = braking_speed(room - flown_on, limits.max_acceleration, limits.reaction_time)
        return _Bound(name, towards, speed)


def _level(way: Vector) -> Vector:
    return np.array([way[0], way[1], 0.0])


def _finite(setpoint: Setpoint) -> bool:
    if isinstance(setpoint, VelocitySetpoint):
        return is_finite(setpoint.velocity) and math.isfinite(setpoint.yaw_rate)
    figures = (setpoint.yaw, setpoint.speed, setpoint.passing_speed)
    scalars = [value for value in figures if value is not None]
    begins = setpoint.position if setpoint.line_from is None else setpoint.line_from
    places = is_finite(setpoint.position) and is_finite(begins)
    return places and all(map(math.isfinite, scalars))
