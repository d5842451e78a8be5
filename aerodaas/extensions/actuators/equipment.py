"""What a vehicle carries to act with: grippers, servos, relays and parachutes, by name.

A driver implements `Actuators` for the actuators of the robot's section in the environment file,
and lists it in its `equipment`. A command names the position that is to be reached, never
a change of the present one: so it may be repeated without harm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

__all__ = ["Actuators", "MoveResult"]


@dataclass(frozen=True, slots=True)
class MoveResult:
    """Result of one command to an actuator."""

    number: int
    """That of `Actuators.move`, or of `Actuators.release_parachute`."""
    accepted: bool
    """Whether the vehicle says that it was done."""
    reason: str = ""
    """Why it was not, in a few words."""


@runtime_checkable
class Actuators(Protocol):
    """The actuators of one vehicle; every method returns at once."""

    def move(self, actuator: str, position: str) -> int:
        """Have an actuator take a position.

        The driver repeats what is not acknowledged.

        Args:
            actuator: Id of the actuator.
            position: One of the configuration's `positions`; of a parachute `enable` and `disable`,
                and never its release.

        Returns:
            A number of this command alone.

        Raises:
            VehicleError: If it certainly cannot.
        """
        ...

    def release_parachute(self, actuator: str) -> int:
        """Fire a parachute, which ends the flight; returns a number of this command alone.

        Raises VehicleError if it certainly cannot.
        """
        ...

    def withdraw(self, number: int) -> None:
        """Repeat the command of this `number` no more, and tell nothing of it.

        One that has been sent may be executed all the same.
        """
        ...

    def results(self) -> list[MoveResult]:
        """Results of commands since the last call."""
        ...
