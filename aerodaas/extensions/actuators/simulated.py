"""Actuators of a simulated drone, in its own steps of time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.extensions.actuators.equipment import MoveResult
from aerodaas.messages.vehicle import VehicleState
from aerodaas.simulation.equipment import SimulatedEquipment

__all__ = ["SimulatedActuators"]

_DURATION = {"gripper": 1.0, "servo": 0.5, "relay": 0.05, "parachute": 0.05}
"""Seconds until a position is taken, by the actuator's type."""


class _Move(NamedTuple):
    number: int
    actuator: str
    position: str
    """Empty for a parachute that is fired."""
    due: int
    """Mission clock at which it is done, nanoseconds."""


class SimulatedActuators(SimulatedEquipment):
    """Do as they are told; implement `Actuators`."""

    replays = True

    def __init__(
        self, robot: RobotConfig, environment: EnvironmentConfig, descend: Callable[[], None]
    ) -> None:
        """Carry those of `robot`; a parachute that opens has it `descend`."""
        super().__init__(robot, environment, descend)
        self._types = {one.id: one.type for one in robot.actuators}
        self._descend = descend
        self._positions: dict[str, str] = {}
        self._moves: list[_Move] = []
        self._results: list[MoveResult] = []
        self._asked = 0
        self._now = 0

    def move(self, actuator: str, position: str) -> int:
        """Take a position from now on.

        Args:
            actuator: Id of the actuator.
            position: Name of its position.

        Returns:
            Number of the move.
        """
        self._asked += 1
        due = self._now + round(_DURATION[self._types[actuator]] * NANOSECONDS)
        self._moves.append(_Move(self._asked, actuator, position, due))
        return self._asked

    def release_parachute(self, actuator: str) -> int:
        """Fire a parachute at the next step of time."""
        return self.move(actuator, "")

    def withdraw(self, number: int) -> None:
        """Leave an actuator as it is, unless it has taken its position already."""
        self._moves = [one for one in self._moves if one.number != number]

    def results(self) -> list[MoveResult]:
        """Results of moves since the last call."""
        results, self._results = self._results, []
        return results

    def complete(self, state: VehicleState) -> VehicleState:
        """Add the positions last taken."""
        return replace(state, actuators=dict(self._positions)) if self._positions else state

    def advance_to(self, stamp: int) -> None:
        """Move until mission time `stamp`, nanoseconds."""
        self._now = stamp
        done = [one for one in self._moves if one.due <= stamp]
        self._moves = [one for one in self._moves if one.due > stamp]
        for one in done:
            if one.position:
                self._positions[one.actuator] = one.position
            else:
                self._positions[one.actuator] = "released"
                self._descend()
            self._results.append(MoveResult(one.number, accepted=True))
