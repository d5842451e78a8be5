"""One leg of a flight: departure to a waypoint, arrival, hover, and detection of a stalled leg."""

from __future__ import annotations

import enum
import math
from dataclasses import replace

import numpy as np

from aerodaas.clock import seconds
from aerodaas.config.sections.robot import LimitsConfig
from aerodaas.geometry.frames import Vector, body_to_enu, length, wrap_angle
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import PositionSetpoint, VehicleState, VelocitySetpoint
from aerodaas.messages.waypoints import VelocityCommand
from aerodaas.mission.navigation.queue import QueuedWaypoint

__all__ = ["Leg", "LegPhase", "setpoint_towards", "unreachable", "velocity_setpoint"]

_TURNING_DISTANCE = 1.0
"""Metres from a place within which the direction to it no longer defines the yaw."""
_FACING = 0.2
"""Yaw error in radians that counts as facing the requested direction."""
_PROGRESS = 0.1
"""Metres of approach that count as progress: more than the position's noise."""
_KEPT = 0.5
"""Metres within which a rangefinder's word is the clearance that is kept by it."""


class LegPhase(enum.Enum):
    """Phases of a leg."""

    UNDER_WAY = enum.auto()
    HOVERING = enum.auto()
    DONE = enum.auto()
    STALLED = enum.auto()
    """The drone has made no progress for longer than the stall time-out."""


def setpoint_towards(
    place: Vector, position: Vector, yaw: float | None, speed: float
) -> PositionSetpoint:
    """Return a setpoint to `place`.

    Args:
        place: Where to fly, ENU metres.
        position: Where the drone is, ENU metres.
        yaw: Radians counter-clockwise from east; None faces along the path.
        speed: Speed on the way, m/s.
    """
    way = place - position
    if yaw is None and math.hypot(way[0], way[1]) > _TURNING_DISTANCE:
        yaw = math.atan2(way[1], way[0])
    return PositionSetpoint(place, yaw, speed)


def unreachable(
    stop: QueuedWaypoint, phase: LegPhase, state: VehicleState | None, limits: LimitsConfig
) -> str:
    """Why a stop is given up, one sentence.

    Args:
        stop: The stop that is given up.
        phase: Phase of the flight to it.
        state: The vehicle's state; None if it has never given one.
        limits: Of the drone; its `rangefinder_clearance` may have kept it above the stop.
    """
    why = "no way inside the geofence leads there"
    if phase is LegPhase.STALLED:
        why = "the drone comes no nearer"
        if state is not None and _kept_up(stop, state, limits):
            kept = f"{limits.rangefinder_clearance:g} m above what is below it"
            why += f", for it stays {kept} (limits.rangefinder_clearance)"
    return f"{stop.id} cannot be reached: {why}"


def _kept_up(stop: QueuedWaypoint, state: VehicleState, limits: LimitsConfig) -> bool:
    """Whether the clearance by a rangefinder holds the drone above a stop."""
    kept, below = limits.rangefinder_clearance, state.below
    if kept <= 0.0 or below is None or below > kept + _KEPT:
        return False
    return bool(state.odometry.height - stop.waypoint.position[2] > limits.arrival_radius)


def velocity_setpoint(command: VelocityCommand, state: VehicleState) -> VelocitySetpoint:
    """Return a velocity command in the local frame, by the drone's yaw.

    Args:
        command: Velocity in the body frame.
        state: The vehicle's state, of which the yaw counts.
    """
    velocity = body_to_enu(command.velocity, state.odometry.yaw)
    return VelocitySetpoint(velocity, command.yaw_rate, command.evasive)


class Leg:
    """The flight to one stop of the queue, and the hover there."""

    def __init__(
        self,
        stop: QueuedWaypoint,
        now: int,
        arrival_radius: float,
        stall_timeout: float,
        before: Leg | None = None,
    ) -> None:
        """Start towards `stop` at `now` (ns); radius in metres, time-out in seconds.

        From the end of the leg `before`, if the drone has arrived there, it keeps to the line.
        """
        stop.under_way = True
        self.stop = stop
        arrived = before is not None and before.stop.arrived
        self._start = before.stop.waypoint.position if before and arrived else None
        self._arrival_radius = arrival_radius
        self._stall_timeout = stall_timeout
        self._nearest = math.inf
        self._nearer_at = now

    def advance(self, odometry: Odometry, now: int, elapsed: float) -> LegPhase:
        """Update with the odometry, and return the phase.

        Args:
            odometry: Where the drone is and where it faces.
            now: Mission clock, nanoseconds.
            elapsed: Time since the last call, seconds.
        """
        stop = self.stop
        distance = length(stop.waypoint.position - odometry.position)
        if stop.arrived:
            stop.remaining_hover -= elapsed
        stop.arrived = stop.arrived or (
            distance <= self._arrival_radius and self.is_facing(odometry.yaw)
        )
        if stop.arrived:
            return LegPhase.DONE if stop.remaining_hover <= 0.0 else LegPhase.HOVERING
        if distance < self._nearest - _PROGRESS:
            self._nearest, self._nearer_at = distance, now
        stalled = seconds(now - self._nearer_at) > self._stall_timeout
        return LegPhase.STALLED if stalled else LegPhase.UNDER_WAY

    def setpoint(
        self,
        place: Vector,
        position: Vector,
        cruise_speed: float,
        heading: float | None = None,
        passing_speed: float = 0.0,
    ) -> PositionSetpoint:
        """Fly on to `place`, at the waypoint's speed.

        Args:
            place: The waypoint or a corner before it, ENU metres.
            position: Where the drone is, ENU metres.
            cruise_speed: Speed for a waypoint without one, m/s.
            heading: Yaw for a waypoint without one, radians; None faces along the path.
            passing_speed: Speed at which the place is passed, m/s.
        """
        waypoint = self.stop.waypoint
        yaw = heading if waypoint.yaw is None else waypoint.yaw
        towards = setpoint_towards(place, position, yaw, waypoint.speed or cruise_speed)
        straight = np.array_equal(place, waypoint.position)
        line_from = self._start if straight else None
        return replace(towards, passing_speed=passing_speed, line_from=line_from)

    def is_facing(self, yaw: float) -> bool:
        """Whether a drone at `yaw` (radians) looks where the waypoint asks for."""
        asked = self.stop.waypoint.yaw
        return asked is None or abs(wrap_angle(asked - yaw)) < _FACING
