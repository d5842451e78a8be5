"""Whether motors that have stopped did so on the ground, after a landing, or in the air."""

from __future__ import annotations

import enum
from collections import deque

import numpy as np

from aerodaas.clock import NANOSECONDS
from aerodaas.geometry import Vector
from aerodaas.navigation.supervisor import has_position
from aerodaas.vehicle import FlightEnd, VehicleMode, VehicleState

__all__ = ["MotorWatch", "Motors"]

_LIFTED = 0.3
"""Metres above the place of take-off from which the drone has left the ground."""
_GENTLE = 2.0
"""m/s up to which sinking is a landing: autopilots touch down at 0.5 to 0.7, and a fall of 0.2 m
is faster."""
_LOOKED_AT = NANOSECONDS
"""Nanoseconds before the stop is seen in which a fall would show: a HEARTBEAT tells of it once a
second."""
_SETTLING = NANOSECONDS // 2
"""Nanoseconds after it in which a drone that hovered would fall by more than a metre."""
_PLACING = 5 * NANOSECONDS
"""Nanoseconds that a vehicle has, after it was not heard of, to say where it stands; one that was
started anew needs longer."""
_COMING_DOWN = frozenset({VehicleMode.LANDING, VehicleMode.RETURNING})


class Motors(enum.Enum):
    """What the motors of one vehicle do."""

    IDLE = enum.auto()
    """They have not started."""
    RUNNING = enum.auto()
    NEVER_LIFTED = enum.auto()
    """They stopped, and the drone had never left the ground."""
    SETTLING = enum.auto()
    """They stopped a moment ago, perhaps after a landing."""
    LANDED = enum.auto()
    """They stopped after the drone had come down gently."""
    STOPPED_IN_FLIGHT = enum.auto()


_ENDS = {
    FlightEnd.LANDED: Motors.LANDED,
    FlightEnd.UNHEARD: Motors.LANDED,
    FlightEnd.FELL: Motors.STOPPED_IN_FLIGHT,
}


class MotorWatch:
    """Follows one vehicle's motors from the ground to the ground.

    A driver that can tell how the flight ended is believed. For one that cannot, a landing is what
    the vehicle itself calls a descent (or what it did while nothing was heard of it), with no
    sinking faster than `_GENTLE` shortly before the motors stop and shortly after.
    """

    def __init__(self, home: Vector) -> None:
        """Watch a vehicle that stands at `home`, ENU metres."""
        self.place = home
        """Where the drone was last known to be with its motors running, ENU metres."""
        self._home = home
        self._state = Motors.IDLE
        self._lifted = False
        self._mode = VehicleMode.GROUNDED
        self._unheard = False
        self._stopped_at = 0
        self._sinking: deque[tuple[int, float]] = deque()
        """When, and how fast in m/s, newest last."""

    def observe(self, state: VehicleState, now: int) -> Motors:
        """Judge `state`, read at `now` (mission clock, nanoseconds)."""
        if state.mode is VehicleMode.LOST:
            self._unheard = True
        elif self._state is not Motors.IDLE and _stands(state) and state.ended is not None:
            self._state = _ENDS[state.ended]
        elif state.armed or state.mode is not VehicleMode.GROUNDED:
            self._run(state, now)
        elif self._state is not Motors.IDLE:
            self._state = self._stop(state, now)
        return self._state

    def _run(self, state: VehicleState, now: int) -> None:
        self._state, self._mode, self._unheard = Motors.RUNNING, state.mode, False
        if has_position(state):
            self.place = state.odometry.position
            self._lifted = self._lifted or float(self.place[2] - self._home[2]) > _LIFTED
        self._note_sinking(state, now)

    def _note_sinking(self, state: VehicleState, now: int) -> None:
        speed = -float(state.odometry.velocity[2])
        if np.isfinite(speed):
            self._sinking.append((now, speed))
        while self._sinking and now - self._sinking[0][0] > _LOOKED_AT:
            self._sinking.popleft()

    def _stop(self, state: VehicleState, now: int) -> Motors:
        if not self._lifted:
            return Motors.NEVER_LIFTED
        if self._state in {Motors.LANDED, Motors.STOPPED_IN_FLIGHT}:
            return self._state
        if self._state is Motors.RUNNING:
            self._stopped_at = now
        self._note_sinking(state, now)
        stood_for = now - self._stopped_at
        if any(speed > _GENTLE for _, speed in self._sinking):
            return Motors.STOPPED_IN_FLIGHT
        if self._mode in _COMING_DOWN or (self._unheard and has_position(state)):
            return Motors.LANDED if stood_for >= _SETTLING else Motors.SETTLING
        waits = self._unheard and stood_for < _PLACING
        return Motors.SETTLING if waits else Motors.STOPPED_IN_FLIGHT


def _stands(state: VehicleState) -> bool:
    """Whether its motors stand, by its own word: an older flight's end says nothing before."""
    return not state.armed and state.mode in {VehicleMode.GROUNDED, VehicleMode.FAILSAFE}
