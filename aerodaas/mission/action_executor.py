"""Executors: what performs the actions of waypoints in one mission, and how extensions add more."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from aerodaas.config.extensions import added
from aerodaas.config.sections.robot import RobotConfig
from aerodaas.errors import failure_line
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.log import MissionLog
from aerodaas.mission.navigation.queue import QueuedWaypoint

__all__ = ["ActionExecutor", "ActionRunner", "added_executors"]


class ActionExecutor:
    """Performs some kinds of actions in one mission; every method returns at once.

    One of an extension (`Extension.action_executors`) is constructed with the vehicle, the robot's
    section of the environment file and the mission's log, for its alerts. The vehicle may be any
    object: an executor asks whether it is one that it can use.
    """

    def objection(self, waypoint: Waypoint) -> str:
        """Why an action of a waypoint is not possible; empty if all are."""
        del waypoint
        return ""

    def poll(self, now: int) -> None:
        """Process what the vehicle has said, once a turn; `now` is the mission clock, ns."""

    def attend(self, stop: QueuedWaypoint, odometry: Odometry, now: int) -> bool:
        """Do what is due for a stop, to which the drone flies or at which it is.

        Args:
            stop: The stop, whose `arrived` tells whether the drone is there.
            odometry: Where the drone is.
            now: Mission clock, nanoseconds.

        Returns:
            Whether the drone has to stay there for it.
        """
        del stop, odometry, now
        return False

    def end(self, now: int) -> None:
        """End what goes on after the mission, at `now` (ns)."""


def added_executors(vehicle: object, robot: RobotConfig, log: MissionLog) -> list[ActionExecutor]:
    """Executors of one mission that extensions add.

    Args:
        vehicle: The vehicle.
        robot: Its section of the environment file.
        log: The mission's log.
    """
    return [executor(vehicle, robot, log) for executor in added("action_executors")]


class ActionRunner(ActionExecutor):
    """All executors of one mission, in order: one begins when those before it are done."""

    def __init__(self, executors: Sequence[ActionExecutor], log: MissionLog) -> None:
        """Call `executors`; what one raises is an alert in `log`, and its action is over."""
        self._executors = executors
        self._log = log

    def objection(self, waypoint: Waypoint) -> str:
        """The first objection; empty for none."""
        return next(filter(None, (one.objection(waypoint) for one in self._executors)), "")

    def poll(self, now: int) -> None:
        """Poll each."""
        for executor in self._executors:
            self._call(executor.poll, now)

    def attend(self, stop: QueuedWaypoint, odometry: Odometry, now: int) -> bool:
        """Attend to a stop by each, until the drone has to stay for one."""
        return any(self._call(one.attend, stop, odometry, now) for one in self._executors)

    def end(self, now: int) -> None:
        """End each."""
        for executor in self._executors:
            self._call(executor.end, now)

    def _call(self, method: Callable[..., Any], *arguments: Any) -> Any:  # noqa: ANN401 - any of its
        """Call a method of an executor, whose last argument is the mission clock."""
        try:
            return method(*arguments)
        except Exception as error:  # noqa: BLE001 - an extension must not end a flight
            text = f"{method.__qualname__}: {failure_line(error)}"
            self._log.alert(arguments[-1], "action", text)
