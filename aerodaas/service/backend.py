"""Interfaces of the API to missions and a fleet, of a provider or of one's own flight."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Protocol, TypeAlias

from aerodaas.config.model import EnvironmentConfig
from aerodaas.messages.health import HealthReport
from aerodaas.mission.commands import Answer
from aerodaas.protocol.piloting import ActuateIn, ControlsIn, RearrangeIn
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import (
    AccountOut,
    CommandIn,
    FleetOut,
    MissionOut,
    NavigationIn,
    PictureForm,
)
from aerodaas.service.access.principal import Principal

__all__ = ["Fleet", "Missions", "PilotCommand", "ShownMissions"]

PilotCommand: TypeAlias = CommandIn | NavigationIn | RearrangeIn | ActuateIn | ControlsIn
"""Command of a pilot to one robot of a mission."""


class ShownMissions(Protocol):
    """Missions by their ids; any account may list and see those that are its own.

    Methods are called in any thread, and raise RefusedError for what the account may not do.
    """

    def missions(self, principal: Principal) -> list[MissionOut]:
        """Missions that an account may see, newest first."""
        ...

    def mission(self, principal: Principal, mission: str) -> MissionOut:
        """One mission with its newest state.

        Args:
            principal: The account that asks.
            mission: Id of the mission.
        """
        ...

    def scenery(self, principal: Principal, mission: str) -> SceneryOut:
        """Ground below a mission on the map.

        Args:
            principal: The account that asks.
            mission: Id of the mission.
        """
        ...


class Missions(ShownMissions, Protocol):
    """Missions that fly, and obey their pilots."""

    def fly(self, principal: Principal, mission: str, command: PilotCommand) -> Answer:
        """Give a robot a command; returns the drone's answer.

        Args:
            principal: The account that asks.
            mission: Id of the mission.
            command: The command, which names the robot.

        Raises:
            MissionError: If the mission is lost.
        """
        ...

    def require_pilot(self, principal: Principal, mission: str) -> None:
        """Check that a mission flies and the account may command it.

        Args:
            principal: The account that asks.
            mission: Id of the mission.

        Raises:
            RefusedError: If it does not fly, or the account may not.
        """
        ...

    def environment(self, principal: Principal, mission: str) -> EnvironmentConfig:
        """Environment of a flying mission that the account may command.

        Args:
            principal: The account that asks.
            mission: Id of the mission.
        """
        ...

    def flies(self, principal: Principal, mission: str) -> bool:
        """Whether a mission is the account's own, so that its presence counts.

        Args:
            principal: The account that asks.
            mission: Id of the mission.
        """
        ...

    def record_presence(self, mission: str) -> None:
        """Record that the user of a mission is there."""
        ...

    def version(self, mission: str) -> int:
        """A number that grows with each change of a mission; -1 once it is over."""
        ...

    def text(self, mission: str) -> tuple[str, bool]:
        """A mission as JSON, and whether it is over."""
        ...

    def items(
        self, mission: str, stream: str, form: PictureForm
    ) -> Iterator[tuple[dict[str, Any], bytes]]:
        """Items of a flying mission's stream.

        Args:
            mission: Id of the mission.
            stream: Name of the stream.
            form: Form of its pictures.

        Raises:
            AeroDaaSError: If there is none.
        """
        ...


class Fleet(Protocol):
    """Drones and accounts, as one account may see them; methods are called in any thread."""

    def account(self, principal: Principal) -> AccountOut:
        """The account that asks."""
        ...

    def seen_by(self, principal: Principal) -> FleetOut:
        """The drones, and the environment that applications are built against."""
        ...

    def fleet_scenery(self) -> SceneryOut:
        """Ground below the fleet on the map."""
        ...

    def preflight(self, robot: str) -> HealthReport:
        """A robot's health before take-off; raises RefusedError for an unknown robot."""
        ...
