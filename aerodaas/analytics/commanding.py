"""Analyses that send commands to the mission at any time and receive its answers."""

from __future__ import annotations

from concurrent.futures import Future
from typing import Protocol

from aerodaas.analytics.base import NavigableAnalytics
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.mission import MissionStatus
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import VehicleState
from aerodaas.mission.commands import Answer, Command

__all__ = ["CommandingAnalytics", "MissionLink"]


class MissionLink(Protocol):
    """Thread-safe interface of an analysis to the mission of one robot."""

    def status(self) -> MissionStatus | None:
        """Newest status of the mission; None before the first."""
        ...

    def vehicle(self) -> VehicleState | None:
        """Newest state of the vehicle; None before the first."""
        ...

    def command(self, command: Command) -> Future[Answer]:
        """Send a command to the mission; the future holds its answer."""
        ...

    def fly(self, navigation: AeroNavigation, index: int | None = None) -> Future[Answer]:
        """Add navigation to the mission, as an item of this analysis' own stream.

        The priority, deadline and order with which the application added that stream apply. A
        waypoint whose id is already queued is refused.

        Args:
            navigation: Waypoints or velocity commands to add.
            index: Number of waypoints of the same priority to visit first; None for the default
                position.

        Returns:
            Future of the mission's answer.
        """
        ...

    def alert(self, alert: Alert) -> None:
        """Publish an alert to the operator: displayed, logged and recorded."""
        ...


class CommandingAnalytics(NavigableAnalytics):
    """An analysis with its own threads that commands the mission, such as a remote control.

    In flight, `begin` is called between `open` and the first `process`. In simulated time, its
    commands take effect in the next cycle of the drone's loop.
    """

    def begin(self, mission: MissionLink) -> None:
        """Start to exchange messages with `mission`, and return without blocking."""
        raise NotImplementedError
