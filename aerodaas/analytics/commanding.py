"""Analyses that talk with the mission whenever they want to, and are answered."""

from __future__ import annotations

from concurrent.futures import Future
from typing import Protocol

from aerodaas.analytics.base import NavigableAnalytics
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.mission.commands import Answer, Command
from aerodaas.types.data import Alert
from aerodaas.types.status import MissionStatus
from aerodaas.types.vehicle import VehicleState

__all__ = ["CommandingAnalytics", "MissionLink"]


class MissionLink(Protocol):
    """The mission of one robot, as seen from an analysis; any thread may use it."""

    def status(self) -> MissionStatus | None:
        """The newest word of the mission; None before the first."""
        ...

    def vehicle(self) -> VehicleState | None:
        """The newest state of the vehicle; None before the first."""
        ...

    def command(self, command: Command) -> Future[Answer]:
        """Tell the mission something; the future holds what it says."""
        ...

    def fly(self, navigation: AeroNavigation, index: int | None = None) -> Future[Answer]:
        """Add navigation, as an item of this analysis' own stream.

        It counts as the application added that stream (its priority, deadline, order); with
        `index`, that many waypoints of the same priority are visited before. A waypoint of an id
        that is already queued is refused.
        """
        ...

    def alert(self, alert: Alert) -> None:
        """Tell the people who watch: shown, logged and recorded."""
        ...


class CommandingAnalytics(NavigableAnalytics):
    """An analysis with threads of its own that commands the mission, such as a remote control.

    In the actor, `begin` is called between `open` and the first `process`. In lockstep, what it
    commands takes effect when the drone's loop next turns.
    """

    def begin(self, mission: MissionLink) -> None:
        """Start talking with `mission`; return at once."""
        raise NotImplementedError
