"""Equipment of a simulated drone that extensions bring, in the drone's own steps of time."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from aerodaas.config.extensions import added
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.messages.vehicle import VehicleState

__all__ = ["SimulatedEquipment", "simulated_equipment"]


class SimulatedEquipment:
    """Equipment of one simulated drone (`Extension.simulated_equipment`)."""

    replays: ClassVar[bool] = False
    """Whether a recorded vehicle that is played has it, too."""

    def __init__(
        self, robot: RobotConfig, environment: EnvironmentConfig, descend: Callable[[], None]
    ) -> None:
        """Equip a drone that stands at its start.

        Args:
            robot: The drone's section of the environment file.
            environment: The whole file.
            descend: Has the drone come down where it is, whatever anybody asks.
        """

    @property
    def awaits_state(self) -> bool:
        """Whether it needs the drone's state after the next step of time (`on_state`)."""
        return False

    def on_state(self, state: VehicleState) -> None:
        """Process the state that it awaits."""

    def advance_to(self, stamp: int) -> None:
        """Let time pass until mission time `stamp`, nanoseconds."""

    def complete(self, state: VehicleState) -> VehicleState:
        """Return the drone's state with what the equipment knows."""
        return state


def simulated_equipment(
    robot: RobotConfig,
    environment: EnvironmentConfig,
    descend: Callable[[], None],
    *,
    replayed: bool = False,
) -> list[SimulatedEquipment]:
    """The equipment that extensions bring for a drone.

    Args:
        robot: The drone's section of the environment file.
        environment: The whole file.
        descend: Has the drone come down where it is, whatever anybody asks.
        replayed: Whether only that is meant which a recorded vehicle has, too.
    """
    return [
        kind(robot, environment, descend)
        for kind in added("simulated_equipment")
        if kind.replays or not replayed
    ]
