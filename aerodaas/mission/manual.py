"""Manual control: who flies the drone by hand, and the velocity to obey until it expires."""

from __future__ import annotations

from aerodaas.clock import NANOSECONDS
from aerodaas.messages.waypoints import VelocityCommand
from aerodaas.mission.commands import ReleaseControls, Steer, TakeControls

__all__ = ["MANUAL_SECONDS", "ManualControl"]

MANUAL_SECONDS = 0.3
"""Longest validity of a velocity by hand, mission time: the dead man's switch of whoever steers.
With the setpoint loop's 0.05 s, the drone brakes within 0.35 s of the last command."""


class ManualControl:
    """The controls of one drone: one operator has them, as long as they are heard of."""

    def __init__(self) -> None:
        """Nobody has the controls."""
        self._session = 0
        self._operator = ""
        self._velocity: VelocityCommand | None = None
        self._expires = 0
        """Mission clock after which the holder counts as silent, nanoseconds."""

    def operator(self, now: int) -> str:
        """Who has the controls at `now`, mission clock in nanoseconds; empty for nobody."""
        return self._operator if now < self._expires else ""

    def handle(self, command: TakeControls | Steer | ReleaseControls, now: int) -> str:
        """Execute a command at `now`; returns why not, or an empty text."""
        holder, own = self.operator(now), command.session == self._session != 0
        match command:
            case TakeControls() if own or not holder:
                self._session, self._operator = command.session, command.operator
                self._hear(None, MANUAL_SECONDS, now)
            case Steer() if own:
                velocity = command.velocity
                self._hear(velocity, min(velocity.valid_for, MANUAL_SECONDS), now)
            case ReleaseControls() if own:
                self._session, self._velocity, self._expires = 0, None, 0
            case _:
                return f"{holder} has the controls" if holder else "take the controls first"
        return ""

    def _hear(self, velocity: VelocityCommand | None, seconds: float, now: int) -> None:
        self._velocity, self._expires = velocity, now + round(seconds * NANOSECONDS)

    def velocity(self, now: int) -> VelocityCommand | None:
        """The velocity to fly at `now`; None to stay where the drone is."""
        moves = self._velocity
        if moves is None or now >= self._expires:
            return None
        return moves if moves.yaw_rate or moves.velocity.any() else None

    def reason(self, now: int) -> str:
        """What to say of the pause at `now`; empty if nobody has flown by hand."""
        if not self._operator:
            return ""
        if self.operator(now):
            return f"flown by hand by {self._operator}"
        silent = self._session != 0
        return f"nothing is heard of {self._operator}" if silent else f"{self._operator} let go"
