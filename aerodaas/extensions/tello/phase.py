"""Flight phase of a Tello, from its state packets: replies get lost and say little."""

from __future__ import annotations

import math

from aerodaas.extensions.tello.state import TelloState
from aerodaas.messages.vehicle import FlightEnd, VehicleMode

__all__ = ["LIFTED", "FlightPhase"]

_MOTORS_STOPPED = 1.5
"""Seconds without a tick of the motors' clock, which counts whole seconds, for them to stand."""
_CALLED_OFF = 4.0
"""Seconds that it must stand after a landing that cancelled a take-off: a `takeoff` that was sent
may arrive later than the `land`, and its motors' clock is a second late."""
LIFTED = 0.3
"""Metres from which it counts as flying."""
_LOW = 0.3
"""Metres above the ground or the place of take-off below which still motors mean standing."""
_HOVERS = 10
"""Packets in a row without climb or descent, a second, after which a take-off has been done, though
its reply was lost."""
_CALM = 0.1
"""m/s."""
_FALLING = 2.0
"""m/s downwards that no Tello descends at by itself."""
_LOOKED_AT = 4.0
"""Seconds before it counts as standing, in which a fall would show: its motors' clock lags."""
_NO_LIFT = 12.0
"""Seconds after a take-off's request within which it must have lifted."""


class FlightPhase:
    """Mode of one Tello, changed by requests and its packets."""

    def __init__(self) -> None:
        """Start on the ground."""
        self.mode = VehicleMode.GROUNDED
        self.risen = False
        """In a take-off: the Tello has done its own part of it and hovers."""
        self.refusal = ""
        """Reason why the latest take-off failed."""
        self.ended: FlightEnd | None = None
        """End of the latest flight; None before and during one."""
        self._lifted = False
        self._fell_at = -math.inf
        self._since = -math.inf
        self._patience = _MOTORS_STOPPED
        self._calm = 0
        self._motor_time: float | None = None
        self._ticked_at = -math.inf

    @property
    def airborne(self) -> bool:
        """True in every mode in which the rotors may turn."""
        return self.mode not in {VehicleMode.GROUNDED, VehicleMode.FAILSAFE}

    @property
    def steered(self) -> bool:
        """True if it can be flown by setpoints."""
        return self.mode in {VehicleMode.HOLDING, VehicleMode.GUIDED}

    @property
    def outcome(self) -> str:
        """Description of a flight's end without a command."""
        fell = self.ended is FlightEnd.FELL
        return "its motors have stopped in flight" if fell else "it has landed by itself"

    def to(self, mode: VehicleMode, now: float) -> None:
        """Change to `mode` by request.

        Args:
            mode: The new mode.
            now: Monotonic clock, seconds.
        """
        off = mode is VehicleMode.LANDING and self.mode is VehicleMode.TAKING_OFF and not self.risen
        self._patience = _CALLED_OFF if off else _MOTORS_STOPPED
        self.mode, self._since = mode, now
        self.risen = False
        self._calm = 0
        if mode is VehicleMode.TAKING_OFF:
            self.refusal = ""
            self._depart()

    def _depart(self) -> None:
        self.ended, self._lifted, self._fell_at = None, False, -math.inf

    def rose(self, refusal: str = "") -> None:
        """Handle the reply to `takeoff`: it hovers, or it gives a reason."""
        if self.mode is not VehicleMode.TAKING_OFF:
            return
        if refusal:
            self.mode = VehicleMode.GROUNDED
            self.refusal = refusal
        else:
            self.risen = True

    def observe(self, state: TelloState, now: float) -> None:
        """Update by a packet.

        Args:
            state: The packet.
            now: Monotonic clock, seconds.
        """
        if self._motor_time is not None and state.motor_time != self._motor_time:
            self._ticked_at = now
        self._motor_time = state.motor_time
        if state.velocity[2] > _FALLING:
            self._fell_at = now
        turning = now - self._ticked_at < _MOTORS_STOPPED
        if turning and state.height >= LIFTED:
            if self.mode is VehicleMode.GROUNDED:
                self.mode = VehicleMode.HOLDING
                self._depart()
            self._lifted = True
            self._calm = self._calm + 1 if abs(state.velocity[2]) <= _CALM else 0
            if self._calm >= _HOVERS:
                self.rose()
            return
        standing = not turning and min(state.height, state.ground_distance) < _LOW
        if not standing or now - self._since < self._patience:
            return
        if self.mode is VehicleMode.LANDING:
            self._end(VehicleMode.GROUNDED, now)
        elif self.mode is VehicleMode.TAKING_OFF and now - self._since > _NO_LIFT:
            self.rose(refusal="it did not lift; is there room and light below it?")
        elif self.steered:
            # Low battery, too hot, or held for too long without a command: it was not requested.
            self._end(VehicleMode.FAILSAFE, now)

    def _end(self, mode: VehicleMode, now: float) -> None:
        self.mode = mode
        if self._lifted:
            fell = now - self._fell_at < _LOOKED_AT
            self.ended = FlightEnd.FELL if fell else FlightEnd.LANDED
