"""Classification of a motor stop: on the ground, after a landing, or in the air."""

from __future__ import annotations

import enum
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from aerodaas.clock import NANOSECONDS
from aerodaas.geometry.frames import Vector
from aerodaas.messages.mission import MissionState
from aerodaas.messages.vehicle import COLLISION, FlightEnd, VehicleMode, VehicleState
from aerodaas.mission.safety.supervisor import has_position

__all__ = ["MotorWatch", "Motors", "MotorsOffRule"]

_LIFTED = 0.3
"""Metres above the take-off position from which the drone has left the ground."""
_GENTLE = 2.0
"""Sink rate in m/s up to which a descent is a landing: autopilots touch down at 0.5 to 0.7, and a
fall of 0.2 m is faster."""
_LOOKED_AT = NANOSECONDS
"""Nanoseconds before a stop is seen in which a fall would show: a HEARTBEAT reports it once a
second."""
_SETTLING = NANOSECONDS // 2
"""Nanoseconds after a stop in which a hovering drone would fall by more than a metre."""
_PLACING = 5 * NANOSECONDS
"""Nanoseconds that a vehicle has to report its position after a lost link; a restarted one needs
longer."""
_COMING_DOWN = frozenset({VehicleMode.LANDING, VehicleMode.RETURNING})


class Motors(enum.Enum):
    """State of one vehicle's motors."""

    IDLE = enum.auto()
    """Not started yet."""
    RUNNING = enum.auto()
    NEVER_LIFTED = enum.auto()
    """Stopped before the drone ever left the ground."""
    SETTLING = enum.auto()
    """Stopped a moment ago, perhaps after a landing."""
    LANDED = enum.auto()
    """Stopped after a gentle descent."""
    STOPPED_IN_FLIGHT = enum.auto()


@dataclass(frozen=True, slots=True)
class MotorsOffRule:
    """Consequence for the mission of a vehicle whose motors do not run."""

    known: bool = True
    """Whether there is nothing to be done for it; False: it may yet start them."""
    ends: MissionState | None = None
    """The state in which the mission is over; None: it is not."""
    reason: str = ""
    alert: str = ""
    """Kind of the alert about it; empty for none."""


_ENDS = {
    FlightEnd.LANDED: Motors.LANDED,
    FlightEnd.UNHEARD: Motors.LANDED,
    FlightEnd.FELL: Motors.STOPPED_IN_FLIGHT,
}


class MotorWatch:
    """Tracks one vehicle's motors from take-off to landing.

    The flight end that a driver reports is authoritative. Without one, a stop is a landing if the
    vehicle reported a descent before (or the link was lost meanwhile), with no sinking faster than
    `_GENTLE` shortly before the motors stop and shortly after.
    """

    def __init__(self, home: Vector) -> None:
        """Watch a vehicle that stands at `home`, ENU metres."""
        self.place = home
        """Last known position with running motors, ENU metres."""
        self._home = home
        self._state = Motors.IDLE
        self._lifted = False
        self._mode = VehicleMode.GROUNDED
        self._unheard = False
        self._stopped_at = 0
        self._sinking: deque[tuple[int, float]] = deque()
        """Time (ns) and sink rate in m/s, newest last."""

    def observe(self, state: VehicleState, now: int) -> Motors:
        """Classify `state`.

        Args:
            state: The vehicle's state.
            now: Mission clock at which it was read, nanoseconds.
        """
        if state.mode is VehicleMode.LOST:
            self._unheard = True
        elif self._state is not Motors.IDLE and _stands(state) and state.ended is not None:
            self._state = _ENDS[state.ended]
        elif state.armed or state.mode is not VehicleMode.GROUNDED:
            self._run(state, now)
        elif self._state is not Motors.IDLE:
            self._state = self._stop(state, now)
        return self._state

    def judge(
        self, state: VehicleState, now: int, *, leaving: str | None, obeyed: bool
    ) -> MotorsOffRule | None:
        """Consequence of `state`; None while the motors run.

        Args:
            state: The vehicle's state.
            now: Mission clock at which it was read, nanoseconds.
            leaving: Reason for which the drone returns or lands; None if it does not.
            obeyed: Whether the vehicle follows commands; False for a recorded one.
        """
        motors = self.observe(state, now)
        if motors is Motors.RUNNING:
            return None
        if motors in {Motors.IDLE, Motors.NEVER_LIFTED}:
            if leaving is None or state.mode is not VehicleMode.GROUNDED:
                return MotorsOffRule(known=False)
            return MotorsOffRule(ends=MissionState.ABORTED, reason=f"{leaving} before take-off")
        if motors is Motors.SETTLING:
            return MotorsOffRule()
        if motors is Motors.LANDED and (leaving is not None or not obeyed):
            ends = None if leaving is None else MissionState.LANDED
            return MotorsOffRule(ends=ends, reason=leaving or "")
        kind, text = self._story(motors, state.faults)
        return MotorsOffRule(ends=MissionState.ABORTED, reason=text, alert=kind)

    def _story(self, motors: Motors, faults: Sequence[str]) -> tuple[str, str]:
        """Kind and text of the alert about `motors` that stopped without being asked to."""
        east, north, up = self.place
        where = f"at E {east:.1f}, N {north:.1f}, up {up:.1f} m"
        if motors is Motors.LANDED:
            why = f": {'; '.join(faults)}" if faults else ""
            return "landed", f"landed of its own accord {where}{why}"
        for fault in faults:
            if fault.startswith(COLLISION):
                return COLLISION, fault
        return "motors_stopped", f"motors stopped in flight {where}"

    def _run(self, state: VehicleState, now: int) -> None:
        self._state, self._mode, self._unheard = Motors.RUNNING, state.mode, False
        if has_position(state):
            self.place = state.odometry.position
            self._lifted = self._lifted or float(self.place[2] - self._home[2]) > _LIFTED
        self._note_sinking(state, now)

    def _note_sinking(self, state: VehicleState, now: int) -> None:
        speed = -float(state.odometry.velocity[2])
        if math.isfinite(speed):
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
    """Whether the vehicle reports stopped motors; until then `ended` may be an older flight's."""
    return not state.armed and state.mode in {VehicleMode.GROUNDED, VehicleMode.FAILSAFE}
